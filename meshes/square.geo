// Square sheet [0, side] x [0, side] with its four edges named (thesis 7.2.2, 7.3.1). Metres.
DefineConstant[ side = 0.254, n = 3, triangles = 0 ];
If (n < 1 || n != Floor(n) || side <= 0)
  Error("n must be a whole number of at least 1, and side positive");
EndIf

Point(1) = {0, 0, 0};
Point(2) = {side, 0, 0};
Point(3) = {side, side, 0};
Point(4) = {0, side, 0};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

Transfinite Curve{1, 2, 3, 4} = n + 1;
Transfinite Surface{1} Alternated;
If (triangles == 0)
  Recombine Surface{1};
EndIf

Physical Surface("sheet") = {1};
Physical Curve("bottom") = {1};
Physical Curve("right") = {2};
Physical Curve("top") = {3};
Physical Curve("left") = {4};
