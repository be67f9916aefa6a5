// Part of a cylinder about the y axis: 0 <= y <= length, and an arc of `angle` degrees from the top (x = 0).
// With its symmetries it is a roof, or an octant of a tube. Every number can be set from outside.
// order 2 puts the nodes at the middles of edges on the cylinder, too.
DefineConstant[ radius = 1, length = 1, angle = 90, nx = 8, ny = 8, triangles = 1, order = 2 ];
If (nx < 1 || nx != Floor(nx) || ny < 1 || ny != Floor(ny) || radius <= 0 || length <= 0 || angle <= 0 || angle > 180)
  Error("nx and ny must be whole numbers of at least 1, radius and length positive, and angle from 0 to 180");
EndIf

Point(1) = {0, 0, 0};
Point(2) = {0, 0, radius};
Point(3) = {radius * Sin(angle * Pi / 180), 0, radius * Cos(angle * Pi / 180)};
Circle(1) = {2, 1, 3};
patch[] = Extrude{0, length, 0}{ Curve{1}; };

Transfinite Curve{1, patch[0]} = nx + 1;
Transfinite Curve{patch[2], patch[3]} = ny + 1;
Transfinite Surface{patch[1]} Alternated;
If (triangles == 0)
  Recombine Surface{patch[1]};
EndIf
Mesh.ElementOrder = order;

Physical Surface("sheet") = {patch[1]};
Physical Curve("middle") = {1};
Physical Curve("end") = {patch[0]};
Physical Curve("top") = {patch[3]};
Physical Curve("side") = {patch[2]};
Physical Point("A") = {2};
Physical Point("B") = {3};
corners[] = Boundary{ Curve{patch[0]}; };
Physical Point("C") = {corners[1]};
