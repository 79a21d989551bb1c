//! A disk that is full, and whoever else wants no more targets.

use std::cell::Cell;
use std::io::{Error, ErrorKind, Write};
use std::time::{Duration, Instant};

use trical_model::interrupt::stoppable;
use trical_program::compensation::Compensator;
use trical_program::{Dialect, Frames, Options, Program, ProgramError, compensate};

use crate::fixtures::{IRB, nominal, real};

/// Targets enough to be solved for a while: a line that the arm can follow, back and forth.
fn program(targets: usize) -> Vec<u8> {
    let mut text = b"x_mm,y_mm,z_mm,qw,qx,qy,qz\n".to_vec();
    for k in 0..targets {
        let y = (k % 200) as f64 - 100.0;
        writeln!(text, "350,{:.3},320,0,0.6,0.8,0", if (k / 200).is_multiple_of(2) { y } else { -y }).unwrap();
    }
    text
}

/// The same with as many behind it that no configuration reaches: whoever solves ahead looks for one long, whoever rewrites
/// has nothing to do.
fn hard_to_solve(easy: usize, hard: usize) -> Vec<u8> {
    let mut text = program(easy);
    for k in 0..hard {
        writeln!(text, "{:.3},0,320,0,0.6,0.8,0", 800.0 + (k % 100) as f64).unwrap();
    }
    text
}

/// A disk with room for so many bytes.
struct Full(usize);

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.0 < bytes.len() {
            return Err(Error::new(ErrorKind::StorageFull, "no space left on device"));
        }
        self.0 -= bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn timed(text: &[u8], sink: &mut dyn Write) -> (Result<usize, ProgramError>, Duration) {
    let (n, options) = (nominal(IRB), Options { temp_c: Some(32.0), ..Options::default() });
    let begin = Instant::now();
    let done =
        compensate(Program::of_file(text, "p.csv", Dialect::Csv, sink), &n, &real(&n), &Frames::default(), &options);
    (done.map(|report| report.rewritten), begin.elapsed())
}

#[test]
fn a_full_disk_ends_the_work_at_once() {
    // what is written first is one block, 2048 targets for each processor
    let easy = 2048 * std::thread::available_parallelism().map_or(1, usize::from).min(16);
    let text = hard_to_solve(easy, 20_000);
    let (done, whole) = timed(&text, &mut std::io::sink());
    assert_eq!(done.unwrap(), easy);
    let (failed, cut) = timed(&text, &mut Full(1000));
    assert_eq!(failed.unwrap_err().to_string(), "cannot be written: no space left on device");
    // the first block is rewritten by then
    assert!(cut < whole.mul_f64(0.5), "{cut:?} of {whole:?}");
}

#[test]
fn nothing_is_solved_ahead_for_whoever_wants_no_more() {
    let text = program(1000);
    let (n, options, frames) = (nominal(IRB), Options::default(), Frames::default());
    let scan = Dialect::Csv.scan(&text).unwrap();
    let all = Compensator::new(&scan, &text, &n, &n, &frames, &options).unwrap();
    let (asked, mut given) = (Cell::new(0), 0);
    let unwanted = || {
        asked.set(asked.get() + 1);
        asked.get() > 350
    };
    all.starts(100, &mut |block| given += block.len(), &unwanted);
    assert_eq!((asked.get(), given), (351, 300));
}

#[test]
fn in_blocks_of_any_size_each_target_has_the_same_joints() {
    // in another order than in the file, some of them twice
    let declared: String = (0..40)
        .map(|k| format!("CONST robtarget p{k}:=[[350,{k},320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"))
        .collect();
    let order = (20..30).chain((5..25).rev()).chain([3, 1, 3, 39]);
    let moved: String = order.map(|k| format!("MoveL p{k},v9,fine,tool0;\n")).collect();
    let text = format!("{declared}PROC main()\nConfL\\Off;\n{moved}ENDPROC\n").into_bytes();
    let (n, options, frames) = (nominal(IRB), Options::default(), Frames::predefined("tool0", "wobj0"));
    let scan = Dialect::Rapid.scan(&text).unwrap();
    let all = Compensator::new(&scan, &text, &n, &n, &frames, &options).unwrap();
    let starts = |size: usize| {
        let mut given = Vec::new();
        all.starts(size, &mut |block| given.extend(block), &|| false);
        format!("{given:?}")
    };
    let whole = starts(1000);
    // those to which no motion goes are none
    assert_eq!(whole.matches("Ok(").count(), 28, "{whole}");
    for size in [1, 7, 27] {
        assert_eq!(starts(size), whole, "{size}");
    }
}

#[test]
fn whoever_started_it_can_stop_it() {
    let text = program(20_000);
    let begin = Instant::now();
    let ask = move || begin.elapsed() > Duration::from_millis(1);
    let (failed, _) = stoppable(ask, || timed(&text, &mut std::io::sink()));
    assert!(failed.unwrap_err().to_string().contains("stopped"));
}
