/PROG A
/MN
   1:J P[5] 100% FINE ;
/POS
P[5:"home"]{
   GP1:
	UF : 0, UT : 2,
	J1= 5e0.deg,	J2= 10.000 deg,	J3= -2e1. deg,
	J4= 3.000 deg,	J5= -60.000 deg,	J6= 10.000 deg
};
/END
