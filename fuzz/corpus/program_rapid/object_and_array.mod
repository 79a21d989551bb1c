%%%
  VERSION:1
%%%
MODULE M
  TASK PERS wobjdata wTable:=[FALSE,TRUE,"",[[10,5,-20],[0.99965732,0,0,0.02617695]],[[0,0,0],[1,0,0,0]]];
  LOCAL CONST robtarget path{2}:=[[[350,50,320],[0,0.6,0.8,0],[0,-1,0,0],[9E+09,9E9,9E9,9E9,9E9,9E9]],
   [[350,60,320],[0,0.6,0.8,0],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];
  PROC main()
    FOR i FROM 1 TO 2 DO
      MoveL path{i},v100,z1,tool0\WObj:=wTable; ! over
    ENDFOR
    MoveAbsJ [[10,20,10,5,60,-7],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs,v200,fine,tool0;
  ENDPROC
ENDMODULE