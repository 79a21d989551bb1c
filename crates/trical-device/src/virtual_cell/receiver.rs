//! The virtual U-WAVE-R: answers on a wire.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use super::wire::Wire;
use super::world::World;
use super::{Fault, lock};
use crate::gauge::uwave_protocol::{self as protocol, Request, Status, Unit};

/// Serves requests until `stop`.
pub(super) fn serve(wire: &mut dyn Wire, world: &Arc<Mutex<World>>, stop: &AtomicBool) {
    let mut pending: Vec<u8> = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        let mut bytes = [0_u8; 256];
        let count = wire.read(&mut bytes);
        pending.extend_from_slice(bytes.get(..count).unwrap_or_default());
        while let Some(end) = pending.iter().position(|byte| *byte == b'\r') {
            let line: Vec<u8> = pending.drain(..=end).take(end).collect();
            let (reply, late, pieces) = {
                let mut world = lock(world);
                world.readings += 1;
                let reply = reply_to(&line, &mut world);
                let late = world.active().find_map(|fault| match fault {
                    Fault::Late { milliseconds } => Some(u64::from(*milliseconds)),
                    _ => None,
                });
                (world.mangle(reply), late, world.has(&Fault::Pieces))
            };
            std::thread::sleep(std::time::Duration::from_millis(late.unwrap_or(0)));
            let parts = reply.chunks(if pieces { 1 } else { reply.len().max(1) });
            let mut sent = Ok(());
            for part in parts {
                sent = sent.and_then(|()| wire.write(part));
            }
            if sent.is_err() {
                break;
            }
        }
        if pending.len() > 256 {
            pending.clear();
        }
    }
}

/// The bytes that the receiver sends on a request.
fn reply_to(line: &[u8], world: &mut World) -> Vec<u8> {
    if world.has(&Fault::Silence) {
        return Vec::new();
    }
    if world.has(&Fault::Garbage) {
        return b"\xff\x00hello\rDT1000\r".to_vec();
    }
    let (group, channels) = (world.options.group, world.options.channels);
    let mut out = String::new();
    match protocol::parse_request(line) {
        None => out.push_str(&protocol::status_record(group, 0, Status::BadRequest).replace("ST10000", "ST1FFFF")),
        Some(Request::Data { channel, group: asked_group, clear }) => {
            let asked = |c: u8| channel.is_none_or(|channel| channel == c) && asked_group == group;
            let axes: Vec<usize> = (0..3).filter(|axis| asked(channels[*axis])).collect();
            if axes.is_empty() {
                let status = protocol::status_record(asked_group, channel.unwrap_or(0), Status::Unregistered);
                out.push_str(&status);
            }
            for axis in axes {
                if world.has(&Fault::Unsolicited) {
                    let other = channels[(axis + 1) % 3];
                    out.push_str(&protocol::data_record(group, other, 9.999, 3, Unit::Millimetre));
                    out.push('\r');
                    out.push_str(&protocol::status_record(group, 77, Status::DataLost));
                    out.push('\r');
                }
                out.push_str(&data_or_fault(world, axis));
                world.cleared[axis] |= clear;
                out.push('\r');
            }
            return out.into_bytes();
        }
        Some(Request::Receiver { group }) => {
            out.push_str(&format!("RI1{group:02}000000000100{}", "0".repeat(50)));
        }
        Some(Request::Transmitter { channel, group }) => {
            match channels.iter().enumerate().filter(|(_, c)| **c >= channel).min_by_key(|(_, c)| **c) {
                Some((axis, found)) => {
                    out.push_str(&format!("TI10{found:02}{group:02}{:010}001", 1000 + axis));
                }
                None => out.push_str(&protocol::status_record(group, channel, Status::EndOfSearch)),
            }
        }
    }
    out.push('\r');
    out.into_bytes()
}

fn data_or_fault(world: &mut World, axis: usize) -> String {
    let (group, channel) = (world.options.group, world.options.channels[axis]);
    let status = world.faults.iter_mut().find_map(|fault| match fault {
        Fault::Status { axis: a, status, times } if *a == axis && *times > 0 => {
            *times -= 1;
            Some(*status)
        }
        _ => None,
    });
    let scheduled = world.options.script.iter().any(|s| matches!(s.fault, Fault::Status { .. }));
    let status = status.or_else(|| {
        // by the script: as long as it lasts
        let faults: Vec<&Fault> = if scheduled { world.active().collect() } else { Vec::new() };
        faults.into_iter().find_map(|fault| match fault {
            Fault::Status { axis: a, status, times: 0 } if *a == axis => Some(*status),
            _ => None,
        })
    });
    if let Some(status) = status {
        return protocol::status_record(group, channel, status);
    }
    let mut out = String::new();
    if world.has(&Fault::BatteryLow { axis }) {
        out.push_str(&protocol::status_record(group, channel, Status::BatteryLow));
        out.push('\r');
    }
    // event mode: a value that was forgotten comes again once it has changed
    if world.cleared[axis] {
        return protocol::status_record(group, channel, Status::NoData);
    }
    // a resolution of zero shows what the record can hold
    let decimals = if world.options.resolution >= 1e-6 { 3 } else { 6 };
    out.push_str(&protocol::data_record(group, channel, world.indicator(axis) * 1e3, decimals, Unit::Millimetre));
    out
}
