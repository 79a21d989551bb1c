//! Collision checks and the choice of configurations.

use trical_ident::{Choice, ParameterSet};
use trical_model::{Forward, Measured, State};
use trical_plan::candidates::Candidates;
use trical_plan::choose::choose;
use trical_plan::{CollisionModel, MotionWorkspace};

use crate::{Task, report, time};

pub fn run(task: &Task) {
    for kind in ["capsule", "box", "hull"] {
        let row = format!("collision check, {kind}s");
        if task.wants(&row) {
            collision(task, kind, &row);
        }
    }
    if task.wants("choice of configurations") {
        choice(task);
    }
}

fn collision(task: &Task, kind: &str, row: &str) {
    let nominal = task.nominal(&format!("scene_{kind}.toml"));
    let model = CollisionModel::new(&nominal.robot, &nominal.cell).unwrap();
    let (poses, mut ws) = (task.joints(), MotionWorkspace::new(&model));
    let hits: Vec<bool> = poses.iter().map(|q| model.check_joints(q, None, &mut ws).is_some()).collect();
    std::fs::write(task.path(&format!("hits_{kind}_trical.txt")), format!("{hits:?}")).unwrap();
    let (pairs, n) = (model.pair_count(), hits.iter().filter(|h| **h).count());
    let t = time(9, |k| model.check_joints(&poses[k % poses.len()], None, &mut ws));
    report(row, "TriCal, Rust", t, &format!("{pairs} pairs, {n} of {} collide", poses.len()));
}

/// 45 of 900 by the determinant: the same rows for everybody, `joints.txt` without its end, as points.
fn choice(task: &Task) {
    let mut model = task.nominal("cell.toml");
    model.frames = vec![trical_model::Pose::identity()];
    let data = crate::identification::load(task, "rigid_points.csv");
    model.terms =
        trical_ident::fit::identifiability::independent_terms(&model, &data, &Choice::from(ParameterSet::Geometry))
            .unwrap()
            .0;
    let p = model.terms.len();
    let forward = Forward::new(model, (0..p).collect()).unwrap();
    let joints = task.joints();
    let pool = &joints[..900];
    let all = |restarts| {
        let (mut ws, mut jacobian) = (forward.workspace(), vec![0.0; 3 * p * pool.len()]);
        let point = Measured::Point { target: 0, position: [0.0; 3] };
        for (q, block) in pool.iter().zip(jacobian.chunks_exact_mut(3 * p)) {
            forward.linearize(&State::at(q), &point, 0, &mut ws, block);
        }
        let candidates = Candidates::new(p, jacobian, vec![0; pool.len()]).unwrap();
        choose(&candidates, &[45], 1, restarts).unwrap()
    };
    for (restarts, who) in [
        (0, "TriCal, Rust, from a greedy start, exchanges"),
        (3, "TriCal, Rust, from a greedy and 3 random starts, as `trical plan`"),
    ] {
        #[expect(clippy::cast_precision_loss, reason = "26")]
        let gain = (all(restarts).log_det / p as f64).exp();
        let words = format!("information per parameter {gain:.4} of the pool's");
        report("choice of configurations", who, time(5, |_| all(restarts).log_det), &words);
    }
}
