// Tensile specimen: a strip along x, fixed at x = 0 and pulled at x = length (thesis 7.2).
// Metres. Every number can be set from outside: meshing.read("strip.geo", comm, nx=18, ny=6).
DefineConstant[ length = 0.0762, width = 0.0254, nx = 9, ny = 3, triangles = 0 ];

Point(1) = {0, 0, 0};
Point(2) = {length, 0, 0};
Point(3) = {length, width, 0};
Point(4) = {0, width, 0};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

Transfinite Curve{1, 3} = nx + 1;
Transfinite Curve{2, 4} = ny + 1;
Transfinite Surface{1} Alternated;
If (triangles == 0)
  Recombine Surface{1};
EndIf

Physical Surface("sheet") = {1};
Physical Curve("fixed_end") = {4};
Physical Curve("pulled_end") = {2};
Physical Point("pin") = {1};
