//! ROS 2 bags of others, written here by hand: joint states while the arm goes from stop to stop, and what an instrument saw of the tool.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use trical_model::Measured;
use trical_recording::Expected;
use trical_recording::mcap::cdr::{JointState, Stamped, StampedKind, string_from_cdr, string_to_cdr};
use trical_recording::mcap::{joint_order, read_any};
use trical_recording::open_large;

/// Stops of the arm, one second each: the angle of joint 1.
const STOPS: [f64; 3] = [0.1, 0.4, -0.2];

/// A stamped message of `geometry_msgs` in CDR: its stamp, the frames, and the numbers.
fn stamped(t: f64, frames: &[&str], numbers: &[f64]) -> Vec<u8> {
    behind(&[], t, frames, numbers)
}

/// The same behind what a message begins with.
fn behind(begin: &[u8], t: f64, frames: &[&str], numbers: &[f64]) -> Vec<u8> {
    let mut out = [&[0, 1, 0, 0], begin].concat();
    let align = |out: &mut Vec<u8>, to: usize| out.resize(4 + (out.len() - 4).next_multiple_of(to), 0);
    for word in [t as u32, (t.fract() * 1e9).round() as u32] {
        out.extend(word.to_le_bytes());
    }
    for frame in frames {
        align(&mut out, 4);
        out.extend((u32::try_from(frame.len()).unwrap() + 1).to_le_bytes());
        out.extend(frame.bytes().chain([0]));
    }
    align(&mut out, 8);
    numbers.iter().for_each(|x| out.extend(x.to_le_bytes()));
    out
}

/// A bag with joint states at 50 Hz and sights at 10 Hz, which `message` writes of the time and joint 1.
fn bag(path: &Path, schema: &str, message: &dyn Fn(f64, f64) -> Vec<u8>) {
    bag_with(path, schema, message, &|_, state| vec![state]);
}

/// The same with joint states that `states` makes of the number and the arm's own.
fn bag_with(
    path: &Path,
    schema: &str,
    message: &dyn Fn(f64, f64) -> Vec<u8>,
    told: &dyn Fn(u32, JointState) -> Vec<JointState>,
) {
    let mut bag = mcap::WriteOptions::new().create(File::create(path).unwrap()).unwrap();
    let mut channel = |topic: &str, schema: &str| {
        let schema = bag.add_schema(schema, "ros2msg", b"").unwrap();
        bag.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
    };
    let (states, sights) = (channel("/joint_states", "sensor_msgs/msg/JointState"), channel("/tracker/pose", schema));
    let mut write = |channel_id, sequence, t: f64, data: &[u8]| {
        let log_time = (t * 1e9) as u64;
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        bag.write_to_known_channel(&header, data).unwrap();
    };
    for k in 0..150_u32 {
        let t = 100.0 + f64::from(k) * 0.02;
        let angle = STOPS[usize::try_from(k / 50).unwrap()];
        let names = ["elbow_joint_2", "elbow_joint_1"].map(str::to_owned).to_vec();
        let seconds = 100 + i32::try_from(k / 50).unwrap();
        let state = JointState {
            seconds,
            nanoseconds: (k % 50) * 20_000_000,
            names,
            position: vec![0.7, angle],
            ..JointState::default()
        };
        told(k, state).iter().for_each(|state| write(states, k, t, &state.to_cdr()));
        if k % 5 == 2 {
            write(sights, k, t, &message(t, angle));
        }
    }
    bag.finish().unwrap();
}

#[test]
fn a_bag_gives_one_row_for_each_stop() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let pose = |t: f64, angle: f64| stamped(t, &["tracker"], &[angle, 2.0, -3.0, 0.0, 0.0, half, half]);
    bag(&path, "geometry_msgs/msg/PoseStamped", &pose);
    let read = read_any(&path, Some(2), None).unwrap().recording;
    assert_eq!((read.joints, read.rows.len()), (2, 3), "{:?}", read.notes);
    for (k, (row, angle)) in read.rows.iter().zip(STOPS).enumerate() {
        // joint 1 is the second of the message, by the number in its name
        assert!((row.state.q[0] - angle).abs() < 1e-12 && (row.state.q[1] - 0.7).abs() < 1e-12, "{:?}", row.state.q);
        let Measured::Pose { position, quaternion } = row.measured else { panic!("a pose: {:?}", row.measured) };
        assert!(position.iter().zip([angle, 2.0, -3.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{position:?}");
        assert!(quaternion.iter().zip([half, 0.0, 0.0, half]).all(|(a, b)| (a - b).abs() < 1e-9), "{quaternion:?}");
        assert_eq!((row.seq, row.line), (Some(k as u64), k + 2));
        let t = row.state.t.unwrap();
        assert!(t > 0.9 * f64::from(u32::try_from(k).unwrap()) - 0.1 && t < f64::from(u32::try_from(k).unwrap()) + 1.0);
    }
    assert_eq!(read.rows[1].state.dir.unwrap()[0], 1);
    assert_eq!(read.rows[2].state.dir.unwrap()[0], -1);
    let said = read.notes.join("\n");
    for part in ["joints 1 to 2 are elbow_joint_1, elbow_joint_2", "by the stamps", "/tracker/pose", "frame 'tracker'"]
    {
        assert!(said.contains(part), "{part} in {said}");
    }
    let message =
        open_large(std::slice::from_ref(&path), &crate::robot(&["revolute"; 2]), true, true).unwrap_err().to_string();
    assert!(message.contains("run.mcap: has no measurements as TriCal writes them; a bag of others"), "{message}");
}

#[test]
fn points_and_transforms_are_read_and_other_topics_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    bag(&path, "geometry_msgs/msg/PointStamped", &|t, angle| stamped(t, &["tracker"], &[angle, 2.0, -3.0]));
    let rows = read_any(&path, Some(2), None).unwrap().recording.rows;
    assert!(matches!(rows[2].measured, Measured::Point { position, .. } if (position[0] - STOPS[2]).abs() < 1e-12));
    let message = read_any(&path, Some(2), Some("/other")).unwrap_err().to_string();
    assert!(message.contains("has measurements (PoseStamped") && message.contains("/tracker/pose"), "{message}");
    // an instrument with a clock of its own: the recorder's counts
    bag(&path, "geometry_msgs/msg/PointStamped", &|t, angle| stamped(t + 1000.0, &["tracker"], &[angle, 2.0, -3.0]));
    let read = read_any(&path, Some(2), None).unwrap().recording;
    assert_eq!(read.rows.len(), 3);
    assert!(read.notes.join("\n").contains("by when they were recorded"), "{:?}", read.notes);
    bag(&path, "geometry_msgs/msg/PointStamped", &|_, angle| stamped(0.0, &["tracker"], &[angle, 2.0, f64::NAN]));
    let message = read_any(&path, Some(2), None).unwrap_err().to_string();
    assert!(message.contains("none of 30 measurements") && message.contains("30 hold no finite numbers"), "{message}");
    bag(&path, "geometry_msgs/msg/Pose", &|_, angle| stamped(0.0, &[], &[angle, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
    let message = read_any(&path, Some(2), None).unwrap_err().to_string();
    assert!(message.contains("has no topic with measurements (PoseStamped"), "{message}");
    assert!(message.ends_with("found geometry_msgs/msg/Pose on /tracker/pose"), "{message}");

    let one = stamped(100.5, &["tracker", "probe"], &[0.25, 2.0, -3.0, 0.0, 0.0, 0.0, 1.0]);
    let read = Stamped::from_cdr(&one, StampedKind::Transform).unwrap();
    assert_eq!((read[0].frame.as_str(), read[0].child.as_str(), read[0].stamp()), ("tracker", "probe", 100.5));
    assert_eq!((read[0].position, read[0].quaternion), ([0.25, 2.0, -3.0], Some([1.0, 0.0, 0.0, 0.0])));
    // twice as long is no rotation
    let long = stamped(0.0, &["tracker", "probe"], &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    assert!(!Stamped::from_cdr(&long, StampedKind::Transform).unwrap()[0].is_whole() && read[0].is_whole());
    let skew = stamped(0.0, &["tracker", "probe"], &[0.0, 0.0, 0.0, 0.5, -0.5, 0.5, 0.5]);
    assert_eq!(Stamped::from_cdr(&skew, StampedKind::Transform).unwrap()[0].quaternion, Some([0.5, 0.5, -0.5, 0.5]));
}

#[test]
fn the_arm_is_told_from_others_on_its_topic_and_lost_measurements_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let far = |t: f64, angle: f64| {
        // one measurement of each stop is lost, another is of something else
        let (lost, else_) = ((t * 10.0).round() % 10.0 == 3.0, (t * 10.0).round() % 10.0 == 5.0);
        stamped(t, &["tracker"], &[angle + if else_ { 0.5 } else { 0.0 }, 2.0, if lost { f64::NAN } else { -3.0 }])
    };
    // a gripper with as many joints publishes first, and the arm's joints come in either order, some without a position
    let told = |k: u32, mut state: JointState| {
        let gripper =
            JointState { names: vec!["finger_a".into(), "finger_b".into()], position: vec![0.0; 2], ..state.clone() };
        if k % 2 == 1 {
            state.names.reverse();
            state.position.reverse();
        }
        if k % 25 == 20 {
            state.position = vec![f64::NAN; 2];
        }
        if k.is_multiple_of(5) { vec![gripper, state] } else { vec![state] }
    };
    bag_with(&path, "geometry_msgs/msg/PointStamped", &far, &told);
    let read = read_any(&path, Some(2), None).unwrap().recording;
    assert_eq!(read.rows.len(), 3, "{:?}", read.notes);
    for (row, angle) in read.rows.iter().zip(STOPS) {
        assert!((row.state.q[0] - angle).abs() < 1e-12 && (row.state.q[1] - 0.7).abs() < 1e-12, "{:?}", row.state.q);
        let Measured::Point { position, .. } = row.measured else { panic!("a point: {:?}", row.measured) };
        assert!((position[0] - angle).abs() < 1e-12, "{position:?}");
    }
    let said = read.notes.join("\n");
    for part in [
        "30 of finger_a, finger_b",
        "6 of 150 joint states on /joint_states have no finite position",
        "3 without finite numbers or a unit quaternion, 3 far from the others of their stop",
        "they are 0.000 mm off at most",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let frames = |t: f64, angle: f64| stamped(t, &[if t > 101.0 { "map" } else { "tracker" }], &[angle, 2.0, -3.0]);
    bag(&path, "geometry_msgs/msg/PointStamped", &frames);
    let message = read_any(&path, Some(2), None).unwrap_err().to_string();
    assert!(message.contains("in the frames 'map', 'tracker'; expected one frame"), "{message}");
}

/// A tree of transforms holds several frames: the only one is taken, and of others the names are told.
#[test]
fn of_a_tree_of_transforms_one_frame_is_the_measurement() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let one = |t, angle| behind(&[1, 0, 0, 0], t, &["tracker", "probe"], &[angle, 2.0, -3.0, 0.0, 0.0, 0.0, 1.0]);
    bag(&path, "tf2_msgs/msg/TFMessage", &one);
    for topic in [None, Some("/tracker/pose:probe")] {
        let rows = read_any(&path, Some(2), topic).unwrap().recording.rows;
        assert_eq!(rows.len(), 3);
        assert!(matches!(rows[2].measured, Measured::Pose { position, .. } if (position[0] - STOPS[2]).abs() < 1e-12));
    }
    let message = read_any(&path, Some(2), Some("/tracker/pose:other")).unwrap_err().to_string();
    assert!(message.contains("has transforms of probe on /tracker/pose; name the frame"), "{message}");
}

/// So does a topic of single transforms, to which an instrument publishes everything that it sees.
#[test]
fn of_transforms_of_several_frames_on_one_topic_one_is_the_measurement() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let both = |t: f64, angle: f64| {
        let (child, x) = if (t * 50.0).round() % 10.0 == 2.0 { ("probe", angle) } else { ("wall", 7.0) };
        stamped(t, &["tracker", child], &[x, 2.0, -3.0, 0.0, 0.0, 0.0, 1.0])
    };
    bag(&path, "geometry_msgs/msg/TransformStamped", &both);
    let message = read_any(&path, Some(2), None).unwrap_err().to_string();
    assert!(message.contains("has transforms of probe, wall on /tracker/pose; name the frame"), "{message}");
    let rows = read_any(&path, Some(2), Some("/tracker/pose:probe")).unwrap().recording.rows;
    let x: Vec<f64> = rows.iter().filter_map(|r| r.measured.lengths().1.first().copied()).collect();
    assert!(x.len() == 3 && x.iter().zip(STOPS).all(|(x, angle)| (x - angle).abs() < 1e-12), "{x:?}");
}

/// Joint states that are missing while the arm moves on do not say where it was.
#[test]
fn what_was_seen_while_joint_states_are_missing_is_no_row() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let seen = |t: f64, angle: f64| stamped(t, &["tracker"], &[if t < 102.0 { t } else { angle }, 2.0, -3.0]);
    let told = |k: u32, mut state: JointState| {
        if k < 12 {
            state.position[1] = 0.01 * f64::from(k);
        }
        if (12..100).contains(&k) { Vec::new() } else { vec![state] }
    };
    bag_with(&path, "geometry_msgs/msg/PointStamped", &seen, &told);
    let read = read_any(&path, Some(2), None).unwrap().recording;
    let q: Vec<f64> = read.rows.iter().map(|r| r.state.q[0]).collect();
    assert!(q.len() == 1 && (q[0] - STOPS[2]).abs() < 1e-12, "{q:?} {:?}", read.notes);
}

#[test]
fn the_joints_of_an_arm_are_told_by_its_description_or_by_the_numbers_in_their_names() {
    let of = |names: &[&str], arm: &[&str], joints: Option<usize>| {
        let names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
        let arm: Vec<String> = arm.iter().map(|n| (*n).to_owned()).collect();
        joint_order(&names, Expected { joints, names: &arm }).map(|found| found.0)
    };
    // as drivers publish them: in the order of the alphabet, two arms in one message
    let baxter = ["right_e0", "right_s0", "right_w0"];
    assert_eq!(of(&baxter, &["right_s0", "right_e0", "right_w0"], Some(3)), Ok(vec![1, 0, 2]));
    let both = ["left_joint_1", "left_joint_2", "right_joint_1", "right_joint_2"];
    assert_eq!(of(&both, &["right_joint_1", "right_joint_2"], Some(2)), Ok(vec![2, 3]));
    assert!(of(&both, &["joint_1", "joint_2"], Some(2)).is_err());
    // other letters behind the number, another number behind it, one behind another
    assert_eq!(of(&["joint_3_u", "joint_1_s", "joint_2_l"], &[], Some(3)), Ok(vec![1, 2, 0]));
    assert_eq!(of(&["J2_7", "J1_7", "J3_7"], &[], Some(3)), Ok(vec![1, 0, 2]));
    assert_eq!(of(&["arm0_j2", "arm0_j1", "grip1"], &[], Some(2)), Ok(vec![1, 0]));
    assert_eq!(of(&["a_1_x", "a_1_y"], &[], Some(2)), Ok(vec![0, 1]));
}

#[test]
fn texts_and_the_order_of_joints_are_what_the_message_says() {
    assert_eq!(string_from_cdr(&string_to_cdr("<robot name='arm'/>")).as_deref(), Some("<robot name='arm'/>"));
    assert_eq!(string_from_cdr(&[0, 1, 0, 0, 9, 0, 0, 0, b'a', 0]), None);
    let names = ["b_2", "b_1", "b_3"].map(str::to_owned);
    let (order, said) = joint_order(&names, Some(3)).unwrap();
    assert_eq!(
        (order, said),
        (vec![1, 0, 2], vec!["joints 1 to 3 are b_1, b_2, b_3, by the numbers in their names".to_owned()])
    );
}
