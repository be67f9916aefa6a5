// Two strips side by side that share nothing, in one group; the left edge of the first is "left".
Point(1)={0,0,0}; Point(2)={.2,0,0}; Point(3)={.2,.1,0}; Point(4)={0,.1,0};
Line(1)={1,2};Line(2)={2,3};Line(3)={3,4};Line(4)={4,1}; Curve Loop(1)={1,2,3,4}; Plane Surface(1)={1};
Point(11)={1,0,0}; Point(12)={1.2,0,0}; Point(13)={1.2,.1,0}; Point(14)={1,.1,0};
Line(11)={11,12};Line(12)={12,13};Line(13)={13,14};Line(14)={14,11}; Curve Loop(11)={11,12,13,14}; Plane Surface(11)={11};
Physical Surface("sheet")={1,11}; Physical Curve("left")={4}; Mesh.MeshSizeMax=0.05;
