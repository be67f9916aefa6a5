// Flat ring, slit along the x axis: "clamped_lip" at the angle 0, "loaded_lip" at 360 degrees, at the same place.
// nx cells across the ring and 4 ny around it. Every number can be set from outside; see cylinder.geo.
DefineConstant[ inner = 6, outer = 10, nx = 4, ny = 6, triangles = 1, order = 2 ];
If (nx < 1 || nx != Floor(nx) || ny < 1 || ny != Floor(ny) || inner <= 0 || outer <= inner)
  Error("nx and ny must be whole numbers of at least 1, and outer larger than inner, larger than 0");
EndIf

Point(100) = {0, 0, 0};
For i In {0:4}
  Point(1 + i) = {inner * Cos(i * Pi / 2), inner * Sin(i * Pi / 2), 0};
  Point(11 + i) = {outer * Cos(i * Pi / 2), outer * Sin(i * Pi / 2), 0};
  Line(1 + i) = {1 + i, 11 + i};
EndFor
For i In {0:3}
  Circle(11 + i) = {1 + i, 100, 2 + i};
  Circle(21 + i) = {11 + i, 100, 12 + i};
  Curve Loop(1 + i) = {1 + i, 21 + i, -(2 + i), -(11 + i)};
  Plane Surface(1 + i) = {1 + i};
EndFor
Transfinite Curve{1:5} = nx + 1;
Transfinite Curve{11:14, 21:24} = ny + 1;
Transfinite Surface{1:4} Alternated;
If (triangles == 0)
  Recombine Surface{1:4};
EndIf
Mesh.ElementOrder = order;

Physical Surface("sheet") = {1:4};
Physical Curve("clamped_lip") = {1};
Physical Curve("loaded_lip") = {5};
Physical Point("A") = {5};
Physical Point("B") = {15};
