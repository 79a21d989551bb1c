/PROG  PICK
/ATTR
COMMENT = "a";
/MN
   1:  !P[9] ;
   2:J P[5:home] 100% FINE    ;
   3:L P[1] 100mm/sec FINE    ;
   4:L P[2] 100mm/sec FINE Offset,PR[1] ;
/POS
/END
