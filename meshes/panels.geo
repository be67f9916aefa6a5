// Two panels that share an edge, the seam at x = split: "left" and "right", from x = 0 to length, y = 0 to width.
// Metres. Every number can be set from outside: meshing.read(MESHES / "panels.geo", nx=4).
DefineConstant[ length = 0.2, width = 0.1, split = 0.1, nx = 4, mx = 4, ny = 4, triangles = 0 ];
If (nx < 1 || nx != Floor(nx) || mx < 1 || mx != Floor(mx) || ny < 1 || ny != Floor(ny) || split <= 0 || length <= split || width <= 0)
  Error("nx, mx and ny must be whole numbers of at least 1, width and split positive, length more than split");
EndIf

Point(1) = {0, 0, 0};
Point(2) = {split, 0, 0};
Point(3) = {length, 0, 0};
Point(4) = {length, width, 0};
Point(5) = {split, width, 0};
Point(6) = {0, width, 0};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 5};
Line(5) = {5, 6};
Line(6) = {6, 1};
Line(7) = {2, 5};
Curve Loop(1) = {1, 7, 5, 6};
Plane Surface(1) = {1};
Curve Loop(2) = {2, 3, 4, -7};
Plane Surface(2) = {2};

Transfinite Curve{1, 5} = nx + 1;
Transfinite Curve{2, 4} = mx + 1;
Transfinite Curve{3, 6, 7} = ny + 1;
Transfinite Surface{1} Alternated;
Transfinite Surface{2} Alternated;
If (triangles == 0)
  Recombine Surface{1, 2};
EndIf

Physical Surface("left") = {1};
Physical Surface("right") = {2};
Physical Curve("fixed_end") = {6};
Physical Curve("pulled_end") = {3};
Physical Curve("bottom") = {1, 2};
Physical Curve("top") = {4, 5};
Physical Curve("seam") = {7};
