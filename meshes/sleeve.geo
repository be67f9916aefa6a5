// A sleeve: a whole cylinder about the x axis, 0 <= x <= length, of flat quadrilaterals. Metres. Every number can be set.
DefineConstant[ radius = 0.05, length = 0.3, around = 40, along = 30 ];
If (around < 4 || around % 4 != 0 || along < 1 || along != Floor(along) || radius <= 0 || length <= 0)
  Error("around must be a multiple of 4, along a whole number of at least 1, radius and length positive");
EndIf

Point(1) = {0, 0, 0};
For k In {0:3}
  Point(2 + k) = {0, radius * Cos(k * Pi / 2), radius * Sin(k * Pi / 2)};
EndFor
For k In {0:3}
  Circle(1 + k) = {2 + k, 1, 2 + (k + 1) % 4};
  Transfinite Curve{1 + k} = Round(around / 4) + 1;
EndFor
sleeve[] = {};
wrist[] = {};
For k In {1:4}
  strip[] = Extrude{length, 0, 0}{ Curve{k}; Layers{along}; Recombine; };
  wrist[] += strip[0];
  sleeve[] += strip[1];
EndFor

Physical Surface("sleeve") = sleeve[];
Physical Curve("shoulder") = {1:4};
Physical Curve("wrist") = wrist[];
