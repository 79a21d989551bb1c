#![allow(clippy::all, clippy::unwrap_used, clippy::print_stdout, missing_docs)]
use std::path::Path;
use trical_ident::*;
use trical_model::*;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let dir = Path::new(&args[1]);
    let robot = Robot::load(&dir.join("robot.toml")).unwrap();
    let cell = Cell::load(&dir.join("cell.toml")).unwrap();
    let recs: Vec<_> = args[3..].iter().map(|f| load_csv(&dir.join(f), robot.dof()).unwrap()).collect();
    let src = if args[2] == "c" { JointSource::Commanded } else { JointSource::Read };
    let t0 = std::time::Instant::now();
    let data = Dataset::build(&recs, src, None).unwrap();
    println!("{} obs {} poses, rejected {}", data.observations.len(), data.poses, data.rejected.len());
    let data = reject_gross_errors(&robot, &cell, &data).unwrap_or_else(|e| panic!("{e}"));
    for r in data.rejected.iter().take(30) {
        println!("  {} {}", r.line, r.reason);
    }
    println!("after gross: {} obs {:?}", data.observations.len(), t0.elapsed());
    for set in [ParameterSet::Nominal, ParameterSet::Geometry, ParameterSet::Compliance, ParameterSet::Complete] {
        let t0 = std::time::Instant::now();
        match identify(&robot, &cell, &data, set) {
            Ok(f) => {
                let e = ErrorSummary::of(&f.errors().unwrap());
                println!(
                    "{set:?} p={} {e:?} {:?} cond {:.1} {:?}",
                    f.free.len(),
                    f.report,
                    f.observability.condition,
                    t0.elapsed()
                );
                if set == ParameterSet::Complete {
                    for k in &f.free {
                        let t = &f.model.terms[*k];
                        println!("   {} {:.6e} sd {:.1e}", t.name, t.value, t.sd.unwrap());
                    }
                    println!("{:?}", f.dependent);
                }
                let t0 = std::time::Instant::now();
                let cv = ErrorSummary::of(&cross_validate(&robot, &cell, &data, set, 4).unwrap());
                println!("   cv {cv:?} {:?}", t0.elapsed());
            }
            Err(e) => println!("{set:?}: {e}"),
        }
    }
}
