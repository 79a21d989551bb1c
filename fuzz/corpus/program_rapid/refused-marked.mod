! compensated by TriCal 0.1.0 with m
MODULE Sample
  ! Targets in the robot's base frame, with the device's tool centre point.
  PERS tooldata tDevice:=[TRUE,[[18,-12,118],[1,0,0,0]],[1.7,[5,-4,55],[1,0,0,0],0,0,0]];
  CONST robtarget pCorner1:=[[300,-150,200],[0,0.70710678,0.70710678,0],[-1,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pCorner2:=[[300,150,200],[0,0.70710678,0.70710678,0],[0,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pCorner3:=[[420,150,260],[0,0.70710678,0.70710678,0],[0,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pCorner4:=[[420,-150,260],
                             [0,0.70710678,0.70710678,0],
                             [-1,0,0,0],
                             [9E9,9E9,9E9,9E9,9