//! From which side each joint comes to a target: as the program's path says, and nothing where it may come from elsewhere.

use trical_model::{Basis, Forward, MAX_JOINTS, Model, Site, State, Term, Tool};
use trical_program::{Dialect, Frames};

use crate::fixtures::{IRB, device, flange, gripper, joints, nominal, rapid, real};
use crate::{run, unmarked};

/// The joints to which the controller is sent are driven on an arm that is put together here: senses from the path, tool and
/// frame by hand.
#[test]
fn frames_senses_and_heat_are_those_of_the_program() {
    let nominal = nominal(IRB);
    let real = real(&nominal);
    let (_, report) = run(&rapid(&nominal), Dialect::Rapid, &nominal, &real, &Frames::default());
    let all = joints([0.0; 6]);
    // in the order of the file: p0, P1, path{1}, path{2}, jHome, inline
    let taught = [0, 1, 2, 4, 9, 3];
    // driven: home, p0, over P1, P1, path{1}, path{2}, inline
    let world_from_base = nominal.cell.world_from_base;
    for (row, k) in report.rows.iter().zip(taught) {
        if k == 9 {
            continue;
        }
        let wanted = world_from_base.compose(&flange(&nominal, &all[k])).compose(&if k.is_multiple_of(2) {
            device()
        } else {
            gripper()
        });
        assert!((row.wanted.translation - wanted.translation).norm() < 2e-8, "{k}");
        let mut arm = real.clone();
        if !k.is_multiple_of(2) {
            arm.cell.tool =
                Tool { tcp: gripper().translation, rotation: gripper().rotation, mass: 0.5, ..arm.cell.tool };
            arm.terms.retain(|t| !matches!(t.site, Site::Tool(_)));
        }
        let arm = Forward::new(arm, vec![]).unwrap();
        let mut ws = arm.workspace();
        // behind the loop over path{i} nobody knows from where
        let senses: &[i8] = if k == 3 { &[0] } else { &[-1, 1] };
        let best = senses
            .iter()
            .flat_map(|a| senses.iter().map(|b| (*a, *b)))
            .map(|(two, three)| {
                let mut dir = [0; MAX_JOINTS];
                (dir[1], dir[2]) = (two, three);
                let state = State { dir: Some(dir), temp_c: Some(32.0), ..State::at(&row.joints) };
                ((arm.world_from_tool(&state, &mut ws).translation - wanted.translation).norm(), two, three)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap();
        assert!(best.0 < 3e-7, "{k}: {best:?}");
        // joints 2 and 3 from home (20, 10) to p0 (12, -8); p0 to path is by P1 (20, 5)
        let senses = match k {
            0 => (-1, -1),
            2 => (-1, 1),
            4 => (1, -1),
            _ => continue,
        };
        assert_eq!((best.1, best.2), senses, "{k}");
    }
}

#[test]
fn senses_matter_and_unknown_ones_are_zero() {
    let nominal = nominal(IRB);
    let real = real(&nominal);
    let text = b"q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,10,5,60,-7\n10,30,10,5,60,-7\n10,20,10,5,60,-7\n";
    let (out, _) = run(text, Dialect::Csv, &nominal, &real, &Frames::default());
    let lines: Vec<String> = String::from_utf8(unmarked(&out)).unwrap().lines().map(str::to_owned).collect();
    // the first is approached from nowhere, the third downwards: half the gap apart
    let q2 = |line: &str| line.split(',').nth(1).unwrap().parse::<f64>().unwrap();
    assert!((q2(&lines[3]) - q2(&lines[1]) - 0.4e-3_f64.to_degrees()).abs() < 2e-4, "{lines:?}");
}

/// A program in which joint 2 goes to what stands behind each `@`, and whether it comes there from below (+), from above (-), or from nobody knows
/// where (=); `motion` writes the k-th of them.
fn senses(d: Dialect, text: &str, motion: &dyn Fn(usize, &str) -> String) -> (String, String) {
    let nominal = nominal(IRB);
    let gap = Term { value: 0.4e-3, ..Term::new("gap_2", "test", Site::Joint { joint: 2 }, Basis::direction(2)) };
    let real = Model { terms: vec![gap], ..nominal.clone() };
    let mut pieces = text.split('@');
    let (mut program, mut told, mut going) = (pieces.next().unwrap().to_owned(), String::new(), Vec::new());
    for (k, piece) in pieces.enumerate() {
        let (q2, rest) = piece.split_at(2);
        program += &motion(k + 1, q2);
        told.push_str(&rest[..1]);
        going.push(q2.parse::<f64>().unwrap().to_radians());
        program += &rest[1..];
    }
    let positions: String = going
        .iter()
        .zip(1..)
        .map(|(q2, k)| format!("P[{k}]{{\n GP1:\n\tUF : 0, UT : 0,\n\tJ1= 10 deg,\tJ2= {:.1} deg,\tJ3= {:.1} deg,\tJ4= 5 deg,\tJ5= 60 deg,\tJ6= -7 deg\n}};\n", q2.to_degrees(), 10.0 - q2.to_degrees()))
        .collect();
    let (_, report) = run(program.replace("POSITIONS", &positions).as_bytes(), d, &nominal, &real, &Frames::default());
    assert_eq!((report.rows.len(), &report.problems[..]), (going.len(), &[][..]), "{program}");
    let found = report.rows.iter().zip(&going).map(|(row, q2)| match q2 - row.joints[1] {
        off if off.abs() < 1e-6 => '=',
        off if off > 0.0 => '+',
        _ => '-',
    });
    (found.collect(), told)
}

#[test]
fn where_the_program_may_come_from_elsewhere_no_sense_is_taken_from_the_text_above() {
    let rapid = "MODULE m\nPROC main()\n@20=\n@30+\nIF a THEN\n@20-\nELSEIF b THEN\n@25-\nELSE\n@25-\nENDIF\n@27=\n@20-\nIF b THEN\nSetDO x,1;\nENDIF\n@30+\n\
        TEST k\nCASE 1:\n@20-\nDEFAULT:\n@25-\nENDTEST\n@27=\n@20-\nIF c SetDO x,1;\nWaitTime 1;\n@30+\npeo;\n@20=\n@30+\npick;\n@20=\n@30+\nopen;\n@20-\nagain:\n@30=\nfetch 3;\n@20=\n@30+\n\
        WHILE a DO\n@20=\n@30+\nENDWHILE\n@20-\nFOR i FROM 1 TO 3 DO\n@25+\nENDFOR\n@20=\nopen;\n@25+\nIF a pick;\n@20=\nERROR\n@25=\n\
        ENDPROC\nPROC fetch(num k)\npick;\nENDPROC\nPROC pick()\n@20=\n@30+\nENDPROC\nPROC open()\nSetDO x,0;\nENDPROC\nENDMODULE\n";
    let krl = "DEF main()\n@20=\n@30+\nIF a THEN\n@20-\nELSE\n@25-\nENDIF\n@27=\n@20-\nIF b THEN\n$OUT[1]=TRUE\nENDIF\n@30+\n\
        SWITCH k\nCASE 1\n@20-\nDEFAULT\n@25-\nENDSWITCH\n@27=\n@20-\npick()\n@30=\n@20-\nopen()\n@30+\nagain:\n@20=\n@30+\nother()\n@20=\n@30+\n\
        LOOP\n@20=\n@30+\nENDLOOP\n@20-\nFOR i=1 TO 3\n@25+\nENDFOR\n@20=\n\
        END\nDEF pick()\n@20=\n@30+\nEND\nDEF open()\n$OUT[1]=TRUE\nEND\n";
    let ur = "def main():\ndef pick():\n@20=\n@30+\nend\ndef open():\nset_digital_out(1,True)\nend\ndef fetch():\npick()\nend\n@20=\n@30+\nif a:\n@20-\nelif b:\n@25-\n\
        else:\n@25-\nend\n@27=\n@20-\nif b:\nopen()\nend\n@30+\nwhile a:\n@20=\n@30+\nend\n@20-\nfetch()\n@30=\n@20-\nopen()\n@30+\nend\n";
    let fanuc = "/PROG A\n/MN\n1:@20=\n2:@30+\n3:IF (DI[1]=ON) THEN ;\n4:@20-\n5:ELSE ;\n6:@25-\n7:ENDIF ;\n8:@27=\n9:@20-\n10:IF DI[1]=ON,JMP LBL[1] ;\n11:@30+\n\
        12:CALL PICK ;\n13:@20=\n14:@30+\n15:LBL[1:again] ;\n16:@20=\n17:IF DI[1]=ON,CALL PICK ;\n18:@30=\n19:DO[1]=ON ;\n20:@20-\n\
        21:GRIP OPEN ;\n22:@30=\n23:FOR R[1]=1 TO 3 ;\n24:@20=\n25:@30+\n26:ENDFOR ;\n27:@20=\n/POS\nPOSITIONS/END\n";
    let third = |q2: &str| 10.0 - q2.parse::<f64>().unwrap();
    let radians = |q2: &str| [10.0, q2.parse::<f64>().unwrap(), third(q2), 5.0, 60.0, -7.0].map(f64::to_radians);
    let abb =
        |_, q2: &str| format!("MoveAbsJ [[10,{q2},{},5,60,-7],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tool0;", third(q2));
    let kuka = |_, q2: &str| format!("PTP {{A1 10,A2 {q2},A3 {},A4 5,A5 60,A6 -7}}", third(q2));
    let teach: &dyn Fn(usize, &str) -> String = &|k, _| format!("J P[{k}] 100% FINE ;");
    for (d, text, motion) in [
        (Dialect::Rapid, rapid, &abb as &dyn Fn(usize, &str) -> String),
        (Dialect::Krl, krl, &kuka),
        (Dialect::UrScript, ur, &|_, q2| format!("movej({:?})", radians(q2))),
        (Dialect::Fanuc, fanuc, teach),
    ] {
        let (found, told) = senses(d, text, motion);
        assert_eq!(found, told, "{d:?}");
    }
}
