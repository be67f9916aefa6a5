// Square sheet [0, side] x [0, side] of 4 x 4 blocks, cut at a, side/2 and side - a, for drape and poke (7.3.2). Metres.
// Corner blocks (a x a) and the middle 2 x 2 blocks have names, and so have corners and centre. n cells along a
// side, even; a a multiple of side/n.
DefineConstant[ side = 2, n = 20, a = 0.1, triangles = 0 ];

x[] = {0, a, side/2, side - a, side};
count[] = {Round(a*n/side), Round(n/2 - a*n/side), Round(n/2 - a*n/side), Round(a*n/side)};
For j In {0:4}
  For i In {0:4}
    Point(1 + i + 5*j) = {x[i], x[j], 0};
  EndFor
EndFor
For j In {0:4}
  For i In {0:3}
    Line(101 + i + 4*j) = {1 + i + 5*j, 2 + i + 5*j};
    Transfinite Curve{101 + i + 4*j} = count[i] + 1;
    Line(201 + j + 5*i) = {1 + j + 5*i, 6 + j + 5*i};
    Transfinite Curve{201 + j + 5*i} = count[i] + 1;
  EndFor
EndFor
For j In {0:3}
  For i In {0:3}
    Curve Loop(1 + i + 4*j) = {101 + i + 4*j, 202 + i + 5*j, -(101 + i + 4*(j + 1)), -(201 + i + 5*j)};
    Plane Surface(1 + i + 4*j) = {1 + i + 4*j};
  EndFor
EndFor
Transfinite Surface{:} Alternated;
If (triangles == 0)
  Recombine Surface{:};
EndIf

Physical Surface("corner_patches") = {1, 4, 13, 16};
Physical Surface("middle") = {6, 7, 10, 11};
Physical Surface("sheet") = {2, 3, 5, 8, 9, 12, 14, 15};
Physical Curve("rim") = {101:104, 117:120, 201, 206, 211, 216, 205, 210, 215, 220};
Physical Point("corners") = {1, 5, 21, 25};
Physical Point("centre") = {13};
