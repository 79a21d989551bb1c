//! The client of Universal Robots against a server that speaks RTDE and takes programs.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use trical_device::controller::{StopCount, UrClient, UrSettings};
use trical_device::{Controller, ControllerError, open_controller};

use crate::ur_server::{Robot, server};

fn connect() -> (UrClient, Arc<Mutex<Robot>>) {
    let (settings, robot) = server();
    (UrClient::connect("127.0.0.1", settings).unwrap(), robot)
}

/// The second program that the robot gets stops it.
fn is_stopped(robot: &Mutex<Robot>) {
    let programs = || robot.lock().unwrap().programs.clone();
    for _ in 0..200 {
        if programs().len() < 2 {
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    assert!(programs()[1].contains("stopj(2.0)"));
}

#[test]
fn joints_come_by_rtde_and_motions_end_with_their_number() {
    let (mut client, robot) = connect();
    assert_eq!(client.joints().unwrap()[..6], [0.1, -1.2, 1.3, -0.4, 0.5, -0.6]);
    client.set_tool([0.018, -0.012, 0.118]).unwrap();
    client.set_speed(0.05, 0.2).unwrap();
    let mut q = [0.0; 9];
    (q[0], q[5]) = (0.5, -3.5);
    client.move_joints(&q).unwrap();
    assert_eq!(client.joints().unwrap(), q);
    client.correct([0.25e-3, -1e-3, 0.0]).unwrap();
    assert!(client.take_history().iter().any(|sample| sample.q == q));
    let (a, b) = (client.clock().unwrap(), client.clock().unwrap());
    assert!(b > a);
    let robot = robot.lock().unwrap();
    assert_eq!(robot.done, 43);
    assert_eq!(
        robot.programs,
        [
            "def trical():\n  set_tcp(p[0.0180000,-0.0120000,0.1180000,0,0,0])\n  movej([0.500000000,0.000000000,0.000000000,\
             0.000000000,0.000000000,-3.500000000], a=0.5, v=0.01082)\n  write_output_integer_register(24, 42)\nend\n",
            "def trical():\n  set_tcp(p[0.0180000,-0.0120000,0.1180000,0,0,0])\n  movel(pose_trans(get_target_tcp_pose(), \
             p[0.000250000,-0.001000000,0.000000000,0,0,0]), a=0.2, v=0.05000)\n  write_output_integer_register(24, 43)\nend\n",
        ]
    );
}

#[test]
fn a_stop_of_the_robot_ends_the_motion_with_its_reason() {
    let (mut client, robot) = connect();
    robot.lock().unwrap().safety = 3;
    // what was on its way before has another mode in it
    for _ in 0..25 {
        client.joints().unwrap();
    }
    let error = client.move_joints(&[0.0; 9]).unwrap_err().to_string();
    assert!(error.contains("protective stop (safety mode 3): look what the arm has met"), "{error}");
    assert!(robot.lock().unwrap().programs.is_empty(), "nothing is sent to an arm that stands");
}

#[test]
fn a_protective_stop_in_the_middle_of_a_motion_is_told_at_once_and_the_program_is_ended() {
    let (mut client, robot) = impatient();
    robot.lock().unwrap().creeps = true;
    let later = Arc::clone(&robot);
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        let mut robot = later.lock().unwrap();
        (robot.creeps, robot.safety) = (false, 3);
    });
    let begin = std::time::Instant::now();
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::SafetyStop { mode: 3, .. }), "{error}");
    assert!(error.to_string().contains("unlock it at the teach pendant"), "{error}");
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    drop(client);
    // it is not to go on once the arm is unlocked
    is_stopped(&robot);
}

#[test]
fn a_motion_that_does_not_end_is_stopped() {
    let (mut client, robot) = connect();
    robot.lock().unwrap().ignores = true;
    let error = client.move_joints(&[0.0; 9]).unwrap_err().to_string();
    assert!(error.contains("not arrived within 0.3 s; is its speed slider at 0"), "{error}");
    drop(client);
    is_stopped(&robot);
}

/// A client that waits long for a motion and short for an answer, of a controller that does not do what programs say.
fn impatient() -> (UrClient, Arc<Mutex<Robot>>) {
    let (settings, robot) = server();
    robot.lock().unwrap().ignores = true;
    let times = (Duration::from_millis(400), Duration::from_secs(60));
    let settings = UrSettings { timeout: times.0, move_timeout: times.1, ..settings };
    (UrClient::connect("127.0.0.1", settings).unwrap(), robot)
}

#[test]
fn an_arm_that_does_not_begin_to_move_is_asked_for_remote_control_and_its_program_is_ended() {
    let (mut client, robot) = impatient();
    let error = client.move_joints(&[0.0; 9]).unwrap_err().to_string();
    assert!(error.contains("does not begin to move; is it in remote control"), "{error}");
    drop(client);
    is_stopped(&robot);
}

#[test]
fn a_motion_of_which_nothing_is_heard_is_ended_long_before_its_own_time() {
    let (mut client, robot) = impatient();
    robot.lock().unwrap().creeps = true;
    let later = Arc::clone(&robot);
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        later.lock().unwrap().silent = true;
    });
    let error = client.move_joints(&[0.0; 9]).unwrap_err().to_string();
    assert!(error.contains("no answer to \"RTDE data\" within 0.4 s"), "{error}");
    drop(client);
    is_stopped(&robot);
}

#[test]
fn a_motion_in_which_the_connection_for_data_is_lost_is_ended_by_the_one_for_programs() {
    let (mut client, robot) = impatient();
    robot.lock().unwrap().creeps = true;
    let later = Arc::clone(&robot);
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(80));
        later.lock().unwrap().closes = true;
    });
    let error = client.move_joints(&[0.0; 9]).unwrap_err().to_string();
    assert!(error.contains("has not confirmed it") && error.contains("the connection is lost"), "{error}");
    drop(client);
    is_stopped(&robot);
}

#[test]
fn an_arm_that_goes_on_after_a_stop_is_not_said_to_stand() {
    let (mut client, robot) = impatient();
    robot.lock().unwrap().creeps = true;
    let stops = StopCount::default();
    client.stop_when(Arc::clone(&stops));
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(80));
        stops.ask();
    });
    let error = client.move_joints(&[0.0; 9]).unwrap_err().to_string();
    assert!(error.contains("has not confirmed it") && error.contains("emergency stop"), "{error}");
    drop(client);
    is_stopped(&robot);
}

#[test]
fn corrections_beyond_the_limit_are_refused() {
    let (mut client, robot) = connect();
    let error = client.correct([6e-3, 0.0, 0.0]).unwrap_err().to_string();
    assert!(error.contains("correction 6.000 mm is over the limit of 5.000 mm"), "{error}");
    assert!(client.correct([f64::NAN, 0.0, 0.0]).is_err());
    assert!(robot.lock().unwrap().programs.is_empty());
}

#[test]
fn controllers_without_the_fields_and_other_servers_are_told() {
    let (settings, robot) = server();
    robot.lock().unwrap().types = "DOUBLE,VECTOR6D,NOT_FOUND,INT32";
    let error = UrClient::connect("127.0.0.1", settings.clone()).err().unwrap().to_string();
    assert!(error.contains("NOT_FOUND") && error.contains("expected DOUBLE"), "{error}");
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = other.local_addr().unwrap().port();
    std::thread::spawn(move || {
        let (mut stream, _) = other.accept().unwrap();
        let _ = stream.read(&mut [0; 100]);
        let _ = stream.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n");
    });
    let error = UrClient::connect("127.0.0.1", UrSettings { rtde_port: port, ..settings }).err().unwrap();
    assert!(error.to_string().contains("expected 3 to 4096"), "{error}");
}

#[test]
fn a_server_that_sends_a_byte_at_a_time_is_not_heard_for_ever() {
    let slow = TcpListener::bind("127.0.0.1:0").unwrap();
    let rtde_port = slow.local_addr().unwrap().port();
    std::thread::spawn(move || {
        let (mut stream, _) = slow.accept().unwrap();
        // a text of 4000 bytes, each of which comes in time
        let mut bytes = [0; 4000];
        bytes[..3].copy_from_slice(&[0x0f, 0xa0, b'M']);
        for byte in bytes {
            std::thread::sleep(Duration::from_millis(30));
            if stream.write_all(&[byte]).is_err() {
                return;
            }
        }
    });
    let (settings, _robot) = server();
    let begin = std::time::Instant::now();
    let settings = UrSettings { rtde_port, timeout: Duration::from_millis(200), ..settings };
    let error = UrClient::connect("127.0.0.1", settings).err().unwrap();
    assert!(matches!(error, ControllerError::Silent { .. }), "{error}");
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}

#[test]
fn the_dashboard_tells_the_serial_number_where_there_is_one_that_knows_it() {
    let (mut client, robot) = connect();
    assert_eq!(client.serial_number().unwrap().as_deref(), Some("20195501234"));
    robot.lock().unwrap().serial_number = "could not understand: 'get serial number'\n";
    assert_eq!(client.serial_number().unwrap(), None);
    let (settings, _robot) = server();
    let mut client = UrClient::connect("127.0.0.1", UrSettings { dashboard_port: 1, ..settings }).unwrap();
    assert_eq!(client.serial_number().unwrap(), None);
}

#[test]
fn the_url_opens_the_client() {
    let (settings, _robot) = server();
    let url = format!("ur://127.0.0.1?rtde_port={}&script_port={}", settings.rtde_port, settings.script_port);
    let mut controller = open_controller(&url).unwrap();
    controller.ping().unwrap();
    assert_eq!(controller.joint_count(), 6);
}

#[test]
fn a_stop_by_the_user_reaches_the_arm() {
    let (settings, robot) = server();
    let settings = UrSettings { move_timeout: Duration::from_secs(60), ..settings };
    let mut client = UrClient::connect("127.0.0.1", settings).unwrap();
    robot.lock().unwrap().ignores = true;
    let stops = StopCount::default();
    client.stop_when(Arc::clone(&stops));
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(80));
        stops.ask();
    });
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::Stopped), "{error}");
    drop(client);
    is_stopped(&robot);
}

#[test]
fn a_joint_motion_moves_the_tool_nowhere_faster_than_asked_for() {
    let (mut client, robot) = connect();
    let arm = trical_model::Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    let arm =
        trical_model::Forward::new(trical_model::Model::nominal(arm, trical_model::Cell::bare()), Vec::new()).unwrap();
    client.set_arm(&arm);
    client.set_speed(0.01, 0.3).unwrap();
    let from = client.joints().unwrap();
    let to: trical_model::Joints = std::array::from_fn(|k| if k < 6 { from[k] + 0.1 * k as f64 } else { 0.0 });
    client.move_joints(&to).unwrap();
    let program = robot.lock().unwrap().programs[0].clone();
    let speed: f64 = program.split("v=").nth(1).unwrap().split(')').next().unwrap().parse().unwrap();
    // the joint that goes farthest, joint 6, goes 0.5 rad at this speed, all others in the same time
    let (mut ws, takes) = (arm.workspace(), 0.5 / speed);
    let mut at = |s: f64| {
        let q: trical_model::Joints = std::array::from_fn(|k| from[k] + s * (to[k] - from[k]));
        arm.world_from_tool(&trical_model::State::at(&q), &mut ws).translation
    };
    let fastest =
        (0..200).map(|k| (at((f64::from(k) + 1.0) / 200.0) - at(f64::from(k) / 200.0)).norm()).fold(0.0, f64::max);
    let fastest = fastest * 200.0 / takes;
    assert!((0.0098..0.01005).contains(&fastest), "{fastest}");
    // one that hardly moves the tool keeps the speed of rotation
    let turned: trical_model::Joints = std::array::from_fn(|k| to[k] + if k == 5 { 0.5 } else { 0.0 });
    client.move_joints(&turned).unwrap();
    assert!(robot.lock().unwrap().programs[1].contains("v=0.30000"));
}
