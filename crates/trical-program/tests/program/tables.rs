//! Tables of poses: units, angles, and what is refused.

use trical_model::{Axis, Basis, Motion, Site, Term};
use trical_program::{Dialect, Frames, Report};

use crate::fixtures::{IRB, nominal, real};
use crate::{refused, run, unmarked};

#[test]
fn a_table_in_other_units_and_with_angles_is_the_same_table() {
    let nominal = nominal(IRB);
    let real = real(&nominal);
    // 0.6 i + 0.8 j is half a turn about an axis in the plane: Rz(2 atan2(0.8, 0.6)) Rx(180 deg)
    let yaw = 2.0 * 0.8_f64.atan2(0.6);
    let text = b"x_mm,y_mm,z_mm,qw,qx,qy,qz\n350,50,320,0,0.6,0.8,0\n".to_vec();
    let others = [
        format!("yaw_deg,note,x_m,y_m,z_m,roll_deg,pitch_deg\n{:.10},a,0.35,0.05,0.32,180,0\n", yaw.to_degrees()),
        format!("X_M,Y_MM,z_mm,roll_rad,pitch_rad,yaw_rad\n0.35,50,320,{:.12},0,{yaw:.12}\n", std::f64::consts::PI),
    ];
    let (_, plain) = run(&text, Dialect::Csv, &nominal, &real, &Frames::default());
    for other in others {
        let (out, report) = run(other.as_bytes(), Dialect::Csv, &nominal, &real, &Frames::default());
        let (_, again) = run(&unmarked(&out), Dialect::Csv, &nominal, &nominal, &Frames::default());
        let apart = |a: &Report, b: &Report| {
            a.rows[0].joints.iter().zip(&b.rows[0].joints).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        assert!(report.after[1] < 1e-6 && apart(&report, &plain) < 1e-6, "{other}: {:?}", report.after);
        // as the controller reads it again
        assert!(apart(&again, &report) < 1e-6, "{}", String::from_utf8_lossy(&out));
    }
    let q = [10.0, 20.0, 10.0, 5.0, 60.0, -7.0];
    let row = |scale: f64| q.map(|x: f64| format!("{:.12}", x * scale)).join(",");
    let head = |unit: &str| (1..=6).map(|k| format!("q{k}_{unit}")).collect::<Vec<_>>().join(",");
    let [deg, rad] = [("deg", 1.0), ("rad", 1_f64.to_radians())].map(|(unit, scale)| {
        let text = format!("{}\n{}\n", head(unit), row(scale));
        let (_, report) = run(text.as_bytes(), Dialect::Csv, &nominal, &real, &Frames::default());
        (report.rows[0].joints, report.after[1])
    });
    assert!(deg.0.iter().zip(&rad.0).all(|(a, b)| (a - b).abs() < 1e-9) && rad.1 < 1e-6, "{deg:?} {rad:?}");
    let angles = refused(b"x,y,z,rx,ry,rz\n1,2,3,4,5,6\n", Dialect::Csv);
    assert!(
        angles.contains("found x,y,z,rx,ry,rz, expected x_mm,y_mm,z_mm") && angles.contains("roll_deg"),
        "{angles}"
    );
    let twice = refused(b"x_mm,y_mm,z_mm,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg\n", Dialect::Csv);
    assert!(twice.contains("twice"), "{twice}");
    // in quotation marks, and with the names of the flange and of the robot's base that its user says nothing of
    let quoted = b"\"name, and place\",\"x_mm\", \"y_mm\",z_mm,qw,qx,qy,qz,tool,frame\n\"a, b\",\"350\",\"50\",320,0,0.6,0.8,0,TOOL0,wobj0\n";
    let (out, report) = run(quoted, Dialect::Csv, &nominal, &real, &Frames::default());
    assert_eq!(report.setups, [("tool 'tool0' in 'wobj0'".to_owned(), 1)], "{:?}", report.problems);
    assert!(String::from_utf8_lossy(&out).contains("\n\"a, b\",\"35"), "{}", String::from_utf8_lossy(&out));
    let own = Frames::parse("[tools.tool0]\nxyz_mm = [0, 0, 7]\n", "f.toml").unwrap();
    let (_, moved) = run(quoted, Dialect::Csv, &nominal, &real, &own);
    assert!((moved.rows[0].joints[1] - report.rows[0].joints[1]).abs() > 1e-3);
    // metres where the columns say millimetres, and the other way round; in a frame a place may be as near
    let small = "x_mm,y_mm,z_mm,qw,qx,qy,qz,frame\n0.35,0.05,0.32,0,0.6,0.8,0,\n";
    let metres = refused(small.as_bytes(), Dialect::Csv);
    assert!(
        metres.contains("line 2, column x_mm: found 0.35, the largest")
            && metres.contains("are in m, the columns are x_m,y_m,z_m"),
        "{metres}"
    );
    let millimetres = refused(b"x_m,y_m,z_m,qw,qx,qy,qz\n350,50,320,0,0.6,0.8,0\n", Dialect::Csv);
    assert!(
        millimetres.contains("line 2, column x_m: found 350, the largest") && millimetres.contains("x_mm,y_mm,z_mm"),
        "{millimetres}"
    );
    let table = Frames::parse("[frames.table]\nxyz_mm = [350, 50, 320]\n", "f.toml").unwrap();
    let on_table = small.replace("0,\n", "0,table\n");
    assert_eq!(run(on_table.as_bytes(), Dialect::Csv, &nominal, &real, &table).1.rewritten, 1);
    let by_tabs = refused(b"x_mm\ty_mm\tz_mm\n1\t2\t3\n", Dialect::Csv);
    assert!(by_tabs.contains("separated by tabs; expected commas"), "{by_tabs}");
    for (header, words) in
        [("x_mm,y_mm,z_mm,qw,qx,qy,qz,x_m,y_m,z_m\n", "x_mm and x_m"), ("q1_deg,q2_deg,q1_deg\n", "q1_deg and q1_deg")]
    {
        let same = refused(header.as_bytes(), Dialect::Csv);
        assert!(same.contains(words), "{same}");
    }
}

#[test]
fn the_tcp_that_a_tracker_saw_is_brought_to_its_place_and_another_target_is_not() {
    let nominal = nominal(IRB);
    let joints_with = |site: Site, elsewhere: f64| {
        let mut model = nominal.clone();
        model.cell.tool.targets[0].x += elsewhere;
        model.terms.push(Term { value: 0.7e-3, ..Term::new("target_y", "test", site, Basis::CONSTANT) });
        let program = b"q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,-10,30,60,50\n";
        run(program, Dialect::Csv, &nominal, &model, &Frames::default()).1
    };
    let target = Site::Target { target: 1, axis: Axis::Y };
    let [tool, seen] = [Site::Tool(Motion::Along(Axis::Y)), target].map(|site| joints_with(site, 0.0));
    assert!((seen.before[1] - 0.7e-3).abs() < 1e-9 && seen.rows[0].joints == tool.rows[0].joints);
    assert_eq!(joints_with(target, 0.02).before[1], 0.0);
}
