// Quarter of a hemisphere about the z axis with a hole of `hole` degrees at the pole.
// Every number can be set from outside; see cylinder.geo.
DefineConstant[ radius = 10, hole = 18, nx = 8, ny = 8, triangles = 1, order = 2 ];
If (nx < 1 || nx != Floor(nx) || ny < 1 || ny != Floor(ny) || radius <= 0 || hole <= 0 || hole >= 90)
  Error("nx and ny must be whole numbers of at least 1, radius positive, and hole between 0 and 90");
EndIf

latitude = (90 - hole) * Pi / 180;
Point(1) = {0, 0, 0};
Point(2) = {radius, 0, 0};
Point(3) = {radius * Cos(latitude), 0, radius * Sin(latitude)};
Circle(1) = {2, 1, 3};
patch[] = Extrude{ {0, 0, 1}, {0, 0, 0}, Pi / 2 }{ Curve{1}; };

Transfinite Curve{1, patch[0]} = ny + 1;
Transfinite Curve{patch[2], patch[3]} = nx + 1;
Transfinite Surface{patch[1]} Alternated;
If (triangles == 0)
  Recombine Surface{patch[1]};
EndIf
Mesh.ElementOrder = order;

Physical Surface("sheet") = {patch[1]};
Physical Curve("y_plane") = {1};
Physical Curve("x_plane") = {patch[0]};
Physical Point("A") = {2};
ends[] = Boundary{ Curve{patch[0]}; };
Physical Point("B") = {ends[0]};
