/PROG  PICK
/ATTR
COMMENT = "a";
/MN
   1:  !P[9] ;
   2:J P[5:home] 100% FINE    ;
   3:L P[1] 100mm/sec FINE    ;
   4:L P[2] 100mm/sec FINE Offset,PR[1] ;
/POS
P[1:"p"]{
   GP1:
	UF : 0, UT : 9,		CONFIG : 'N U T, 0, 0, 0',
	X = 350.00000  mm,	Y = 50.00000  mm,
	Z = 30.00000  mm,
	W = 180.000000 deg,	P = 0.000000 deg,	R = 106.260205 deg
};
/END
