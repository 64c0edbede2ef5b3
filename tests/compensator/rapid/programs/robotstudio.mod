MODULE Module1
	CONST robtarget Target_10:=[[10,20,5],[0,0,1,0],[0,0,-1,1],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
	CONST robtarget Target_20:=[[10,20,-1.5],[0,0,1,0],[0,0,-1,1],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
	CONST robtarget Target_30:=[[60.123456,20,-1.5],[-8.5E-07,0.010471784,0.999945169,0],[0,0,-1,1],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]; ! corner
	CONST jointtarget Home:=[[0,0,0,0,30,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

	PROC Path_10()
		MoveAbsJ Home\NoEOffs,v1000,z100,tMill\WObj:=Workobject_1;
		MoveJ Target_10,v1000,z10,tMill\WObj:=Workobject_1;
		MoveL Target_20,v50,fine,tMill\WObj:=Workobject_1;
		MoveL Target_30,v50,z1,tMill\WObj:=Workobject_1;
		MoveL Target_20,v50,z1,tMill\WObj:=Workobject_1;
		MoveL Offs(Target_20,0,0,50),v1000,z10,tMill\WObj:=Workobject_1;
	ENDPROC
	PROC main()
		Path_10;
	ENDPROC
ENDMODULE
