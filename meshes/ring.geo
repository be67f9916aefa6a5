// Flat ring about the z axis, as of a drape test: nx cells across the ring and 4 ny around it. "inner" and "outer" rim.
// Metres. Every number can be set from outside: meshing.read("ring.geo", comm, 3, nx=6, ny=19).
DefineConstant[ inner = 0.09, outer = 0.15, nx = 6, ny = 19, triangles = 0 ];
If (nx < 1 || nx != Floor(nx) || ny < 1 || ny != Floor(ny) || inner <= 0 || outer <= inner)
  Error("nx and ny must be whole numbers of at least 1, and outer larger than inner, larger than 0");
EndIf

Point(100) = {0, 0, 0};
For i In {0:3}
  Point(1 + i) = {inner * Cos(i * Pi / 2), inner * Sin(i * Pi / 2), 0};
  Point(11 + i) = {outer * Cos(i * Pi / 2), outer * Sin(i * Pi / 2), 0};
  Line(1 + i) = {1 + i, 11 + i};
EndFor
For i In {0:3}
  j = (i + 1) % 4;
  Circle(11 + i) = {1 + i, 100, 1 + j};
  Circle(21 + i) = {11 + i, 100, 11 + j};
  Curve Loop(1 + i) = {1 + i, 21 + i, -(1 + j), -(11 + i)};
  Plane Surface(1 + i) = {1 + i};
EndFor
Transfinite Curve{1:4} = nx + 1;
Transfinite Curve{11:14, 21:24} = ny + 1;
Transfinite Surface{1:4} Alternated;
If (triangles == 0)
  Recombine Surface{1:4};
EndIf

Physical Surface("sheet") = {1:4};
Physical Curve("inner") = {11:14};
Physical Curve("outer") = {21:24};
