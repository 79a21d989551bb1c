MODULE Sample
  ! Targets in the robot's base frame, with the device's tool centre point.
  PERS tooldata tDevice:=[TRUE,[[18,-12,118],[1,0,0,0]],[1.7,[5,-4,55],[1,0,0,0],0,0,0]];
  CONST robtarget pCorner1:=[[300,-150,200],[0,0.70710678,0.70710678,0],[-1,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pCorner2:=[[300,150,200],[0,0.70710678,0.70710678,0],[0,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pCorner3:=[[420,150,260],[0,0.70710678,0.70710678,0],[0,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pCorner4:=[[420,-150,260],
                             [0,0.70710678,0.70710678,0],
                             [-1,0,0,0],
                             [9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pTilted:=[[350,50,320],[0.1305262,0.6916548,0.7004209,0.1206591],[0,-1,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST jointtarget jReady:=[[10,20,10,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

  PROC main()
    MoveAbsJ jReady,v200,fine,tDevice;
    MoveL pCorner1,v100,fine,tDevice;
    MoveL pCorner2,v100,fine,tDevice;
    MoveL pCorner3,v100,fine,tDevice;
    MoveL Offs(pCorner4,0,0,10),v100,fine,tDevice;   ! relative to a target: follows it
    MoveL pTilted,v100,fine,tDevice;
    MoveL [[380,-60,240],[0,0.70710678,0.70710678,0],[-1,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tDevice;
  ENDPROC
ENDMODULE
