//! The virtual controller: speaks the RAPID dialect on a TCP port, one client at a time.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::world::World;
use super::{Fault, lock};
use crate::controller::rapid_protocol::{self as protocol, code};
use trical_recording::motion::JointSample;

/// A client that says nothing for so long while the arm moves is taken for gone, as the module does.
const WATCHDOG: Duration = Duration::from_secs(5);

/// Who has not given the secret by then is disconnected, as the module does.
const LOGIN_WITHIN: Duration = Duration::from_secs(10);

/// Serves clients until `stop`.
pub(super) fn serve(listener: &TcpListener, world: &Arc<Mutex<World>>, stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => {
                // an error ends this client; the next one may come
                let _ = serve_client(stream, world, stop);
            }
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

fn serve_client(mut stream: TcpStream, world: &Arc<Mutex<World>>, stop: &AtomicBool) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(20)))?;
    let mut pending: Vec<u8> = Vec::new();
    let secret = lock(world).options.secret.clone();
    let (mut known, begin) = (secret.is_none(), Instant::now());
    while !stop.load(Ordering::Relaxed) && (known || begin.elapsed() < LOGIN_WITHIN) {
        let mut bytes = [0_u8; 256];
        match stream.read(&mut bytes) {
            Ok(0) => return Ok(()),
            Ok(count) => pending.extend_from_slice(bytes.get(..count).unwrap_or_default()),
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {}
            Err(error) => return Err(error),
        }
        while let Some(end) = pending.iter().position(|byte| *byte == b'#') {
            let message: Vec<u8> = pending.drain(..=end).take(end).collect();
            let given = protocol::parse_login(&message);
            if given.is_some() || !known && protocol::parse_request(&message).is_some() {
                let refused = match (given, &secret) {
                    (_, None) => Some(protocol::SECRET_NOT_SET),
                    (None, Some(_)) => Some(protocol::SECRET_EXPECTED),
                    (Some(given), Some(secret)) => (given != secret.text()).then_some(protocol::SECRET_WRONG),
                };
                let reply = protocol::write_reply(code::LOGIN, refused.is_none(), refused.unwrap_or_default());
                stream.write_all(reply.as_bytes())?;
                if refused.is_some() {
                    return Ok(());
                }
                known = true;
                continue;
            }
            if !known {
                return Ok(());
            }
            let (reply, takes, pieces, stalls) = {
                let mut world = lock(world);
                world.commands += 1;
                world.jog();
                let stalls = world.has(&Fault::Stall) && is_motion(&message);
                let pieces = world.has(&Fault::Pieces);
                let begin = world.clock();
                let Some(reply) = reply_to(&message, &mut world) else { return Ok(()) };
                (reply, (world.clock() - begin) * world.options.pace, pieces, stalls)
            };
            let mut reply = reply;
            if takes > 0.0 {
                if let Some(end) = travel(takes, &mut stream, &mut pending, stop)? {
                    lock(world).stop_at(end.part);
                    let code = protocol::parse_request(&message).map_or(0, |request| request.code);
                    reply = protocol::write_reply(code, false, "stopped");
                    if end.asked {
                        reply.push_str(&protocol::write_reply(code::STOP, true, ""));
                    }
                }
                lock(world).stand();
            }
            if stalls {
                continue;
            }
            for part in reply.as_bytes().chunks(if pieces { 1 } else { reply.len().max(1) }) {
                stream.write_all(part)?;
            }
        }
        if pending.len() > protocol::LONGEST {
            return Ok(());
        }
    }
    Ok(())
}

/// A motion that ended early.
struct Stopped {
    /// How much of it was made, 0 to 1.
    part: f64,
    /// Whether the client has asked for it.
    asked: bool,
}

/// Lets the real time of a motion pass, in s. It is stopped where the client asks for it, is gone, or says nothing any more.
fn travel(
    seconds: f64,
    stream: &mut TcpStream,
    pending: &mut Vec<u8>,
    stop: &AtomicBool,
) -> io::Result<Option<Stopped>> {
    let begin = Instant::now();
    let mut heard = begin;
    stream.set_nonblocking(true)?;
    let result = loop {
        let part = begin.elapsed().as_secs_f64() / seconds;
        if part >= 1.0 || stop.load(Ordering::Relaxed) {
            break None;
        }
        let mut bytes = [0_u8; 256];
        match stream.read(&mut bytes) {
            Ok(count @ 1..) => {
                heard = Instant::now();
                pending.extend_from_slice(bytes.get(..count).unwrap_or_default());
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => std::thread::sleep(Duration::from_millis(2)),
            Ok(0) | Err(_) => break Some(Stopped { part, asked: false }),
        }
        let end = pending.iter().position(|byte| *byte == b'#');
        let code = end.and_then(|end| protocol::parse_request(pending.get(..end)?)).map(|request| request.code);
        match (code, end) {
            (Some(code::STOP), Some(end)) => {
                pending.drain(..=end);
                break Some(Stopped { part, asked: true });
            }
            (Some(code::ALIVE), Some(end)) => {
                pending.drain(..=end);
                stream.write_all(protocol::write_reply(code::ALIVE, true, "").as_bytes())?;
            }
            // what else is asked for waits for the motion's end
            _ => {}
        }
        if heard.elapsed() > WATCHDOG || pending.len() > protocol::LONGEST {
            break Some(Stopped { part, asked: false });
        }
    };
    stream.set_nonblocking(false)?;
    Ok(result)
}

/// Whether the arm is to move, or somebody wants to know how it moves.
fn is_motion(message: &[u8]) -> bool {
    let code = protocol::parse_request(message).map(|request| request.code);
    matches!(code, Some(code::MOVE_JOINTS | code::CORRECT | code::ALIVE | code::STOP))
}

/// What the controller sends on a request; `None` closes the connection.
fn reply_to(message: &[u8], world: &mut World) -> Option<String> {
    if world.has(&Fault::DropConnection) {
        return None;
    }
    // who speaks another language may have a command somewhere in what follows
    let request = protocol::parse_request(message)?;
    let (count, slides) = (world.joint_count(), world.slides());
    let wrong_count = || Err("wrong number of parameters".to_owned());
    let mut samples = Vec::new();
    let mut moved = |result: Result<Vec<JointSample>, String>| {
        result.map(|taken| {
            samples = taken;
            String::new()
        })
    };
    let result: Result<String, String> = match (request.code, request.parameters.as_slice()) {
        (code::PING | code::TOOL | code::STOP | code::ALIVE, _) => Ok(String::new()),
        (code::MOVE_JOINTS, degrees) => match protocol::parse_joints(degrees, count, &slides) {
            Some(target) => moved(world.move_joints(&target)),
            None => wrong_count(),
        },
        (code::JOINTS, _) => Ok(protocol::write_joints(&world.joints(), count, &slides)),
        (code::SPEED, [linear, angular]) => {
            world.set_speed(linear * 1e-3, angular.to_radians()).map(|()| String::new())
        }
        (code::ZONE, [fine]) if *fine == 1.0 => Ok(String::new()),
        (code::ZONE, _) => Err("only fine".to_owned()),
        (code::CORRECT, [x, y, z]) => moved(world.correct([x * 1e-3, y * 1e-3, z * 1e-3])),
        (code::CLOCK, _) => Ok(format!("{:.3}", world.clock_shown())),
        (code::STREAM, [interval]) if *interval >= 0.0 => {
            world.stream_interval = interval * 1e-3;
            Ok(String::new())
        }
        (code::TEMPERATURE, _) => Ok(world.temperature().map(|t| format!("{t:.2}")).unwrap_or_default()),
        (code::IDENTIFY, _) => {
            Ok(format!("TriCal {} {count} {:.3}", protocol::VERSION, world.options.correction_limit * 1e3))
        }
        (code::SERIAL_NUMBER, _) => Ok(world.options.serial_number.clone().unwrap_or_default()),
        (code::CLOSE, _) => return None,
        (code::SPEED | code::CORRECT | code::STREAM, _) => wrong_count(),
        _ => Err("unknown code".to_owned()),
    };
    let mut reply: String = samples
        .iter()
        .map(|sample| {
            let data = format!("{:.3} {}", sample.t, protocol::write_joints(&sample.q, count, &slides));
            protocol::write_reply(code::SAMPLE, true, &data)
        })
        .collect();
    reply.push_str(&match result {
        Ok(data) => protocol::write_reply(request.code, true, &data),
        Err(reason) => protocol::write_reply(request.code, false, &reason),
    });
    Some(reply)
}
