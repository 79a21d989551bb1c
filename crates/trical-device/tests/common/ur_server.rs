//! A Universal Robots controller that speaks RTDE and takes programs.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use trical_device::controller::UrSettings;
use trical_device::controller::rtde::{self, kind};

/// The controller behind it.
pub struct Robot {
    pub q: [f64; 6],
    pub done: i32,
    pub safety: i32,
    pub programs: Vec<String>,
    pub ignores: bool,
    /// Moves whatever it is told.
    pub creeps: bool,
    /// Sends no data.
    pub silent: bool,
    /// Closes the connection for data.
    pub closes: bool,
    pub types: &'static str,
    /// What the dashboard says of it.
    pub serial_number: &'static str,
}

fn read_package(stream: &mut TcpStream) -> Option<(u8, Vec<u8>)> {
    let mut head = [0; 3];
    stream.read_exact(&mut head).ok()?;
    let mut content = vec![0; usize::from(u16::from_be_bytes([head[0], head[1]])) - 3];
    stream.read_exact(&mut content).ok()?;
    Some((head[2], content))
}

/// Answers the greeting, then sends data until the client has gone.
fn data(mut stream: TcpStream, robot: &Mutex<Robot>) -> Option<()> {
    loop {
        let (kind, content) = read_package(&mut stream)?;
        let reply = match kind {
            kind::VERSION => {
                assert_eq!(content, [0, 2]);
                vec![1]
            }
            kind::OUTPUTS => {
                assert_eq!(&content[8..], rtde::FIELDS.as_bytes());
                [&[7], robot.lock().unwrap().types.as_bytes()].concat()
            }
            _ => vec![1],
        };
        // the controller's own words may come between
        stream.write_all(&rtde::package(kind::TEXT, b"hello")).ok()?;
        stream.write_all(&rtde::package(kind, &reply)).ok()?;
        if kind == kind::START {
            break;
        }
    }
    for tick in 0.. {
        let mut content = vec![7];
        {
            let mut robot = robot.lock().unwrap();
            if robot.closes {
                return None;
            }
            if robot.silent {
                drop(robot);
                std::thread::sleep(Duration::from_millis(2));
                continue;
            }
            robot.q[0] += if robot.creeps { 1e-4 } else { 0.0 };
            content.extend((0.002 * f64::from(tick)).to_be_bytes());
            robot.q.iter().for_each(|q| content.extend(q.to_be_bytes()));
            content.extend(robot.done.to_be_bytes());
            content.extend(robot.safety.to_be_bytes());
        }
        let bytes = rtde::package(kind::DATA, &content);
        // in pieces, as networks do
        let (a, b) = bytes.split_at(usize::try_from(tick % 60).unwrap());
        stream.write_all(a).ok()?;
        stream.write_all(b).ok()?;
        std::thread::sleep(Duration::from_millis(2));
    }
    Some(())
}

fn numbers(text: &str) -> Vec<f64> {
    text.split(',').map(|word| word.trim().parse().unwrap()).collect()
}

/// Takes programs: a motion is done at once, and its number written.
fn programs(mut stream: TcpStream, robot: &Mutex<Robot>) {
    let mut text = String::new();
    let mut some = [0; 256];
    while let Ok(count @ 1..) = stream.read(&mut some) {
        text.push_str(std::str::from_utf8(&some[..count]).unwrap());
        while let Some(end) = text.find("\nend\n") {
            let program: String = text.drain(..end + 5).collect();
            let mut robot = robot.lock().unwrap();
            robot.programs.push(program.clone());
            if robot.ignores {
                continue;
            }
            if let Some((_, after)) = program.split_once("movej([") {
                robot.q.copy_from_slice(&numbers(after.split_once(']').unwrap().0));
            }
            if let Some((_, after)) = program.split_once("write_output_integer_register(24, ") {
                robot.done = after.split_once(')').unwrap().0.parse().unwrap();
            }
        }
    }
}

fn data_to(stream: TcpStream, robot: &Mutex<Robot>) {
    let _ = data(stream, robot);
}

/// Greets with a line, and answers with one.
fn dashboard(mut stream: TcpStream, robot: &Mutex<Robot>) {
    let _ = stream.write_all(b"Connected: Universal Robots Dashboard Server\n");
    let mut some = [0; 64];
    while let Ok(count @ 1..) = stream.read(&mut some) {
        assert_eq!(&some[..count], b"get serial number\n");
        let _ = stream.write_all(robot.lock().unwrap().serial_number.as_bytes());
    }
}

/// All ports, and what stands behind them.
pub fn server() -> (UrSettings, Arc<Mutex<Robot>>) {
    let robot = Arc::new(Mutex::new(Robot {
        q: [0.1, -1.2, 1.3, -0.4, 0.5, -0.6],
        done: 41,
        safety: 1,
        programs: Vec::new(),
        ignores: false,
        creeps: false,
        silent: false,
        closes: false,
        types: rtde::TYPES,
        serial_number: "20195501234\n",
    }));
    let ports = [data_to as fn(TcpStream, &Mutex<Robot>), programs, dashboard].map(|answers| {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let robot = Arc::clone(&robot);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let robot = Arc::clone(&robot);
                std::thread::spawn(move || answers(stream.unwrap(), &robot));
            }
        });
        port
    });
    let settings = UrSettings {
        rtde_port: ports[0],
        script_port: ports[1],
        dashboard_port: ports[2],
        move_timeout: Duration::from_millis(300),
        ..UrSettings::default()
    };
    (settings, robot)
}
