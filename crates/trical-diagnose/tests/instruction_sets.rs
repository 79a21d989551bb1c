//! The same digits whatever instructions the processor has: the test runs itself again under processors that say they have less.
//!
//! A processor that can trap the instruction CPUID lets a process answer it: what asks it (the standard library, `pulp`) then sees no AVX. The C library asks
//! before the process can and is told by `GLIBC_TUNABLES`. Where the processor cannot trap it, the levels below its own are skipped, which is printed.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]
// a handler of a signal, and the registers that it answers with, are outside of what Rust can check
#![allow(unsafe_code)]

#[path = "../../trical-ident/tests/common/arm.rs"]
mod arm;

use std::arch::x86_64::__cpuid_count;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

use trical_diagnose::diagnose;
use trical_ident::{
    Aim, CsvStream, ModelFile, Options, ParameterSet, Scatter, calibrate, calibrate_stream, simulate, validate,
    write_csv,
};
use trical_model::{Basis, Site, Task, Term};

/// Levels of x86-64: the first, the one before AVX-512, and all that the processor has.
const LEVELS: [u32; 3] = [1, 3, 4];

/// Of the process that calculates: its level, and the file that it writes.
const LEVEL: &str = "TRICAL_TEST_LEVEL";
const FIGURES: &str = "TRICAL_TEST_FIGURES";

#[test]
fn every_instruction_set_gives_the_same_digits() {
    let dir = tempfile::tempdir().unwrap();
    let figures: Vec<Option<String>> = LEVELS.iter().map(|level| at_level(*level, dir.path())).collect();
    let all = figures.last().unwrap().as_ref().unwrap();
    assert!(all.lines().count() > 5 && all.len() > 20_000, "{all}");
    for (level, figures) in LEVELS.iter().zip(&figures) {
        let Some(figures) = figures else { continue };
        for (of_level, of_all) in figures.lines().zip(all.lines()) {
            if of_level != of_all {
                let at = of_level.bytes().zip(of_all.bytes()).position(|(a, b)| a != b).unwrap_or(0);
                let near = |text: &str| text.chars().skip(at.saturating_sub(80)).take(120).collect::<String>();
                let name = of_all.split('\t').next();
                panic!("level {level}, {name:?}:\n{}\ninstead of\n{}", near(of_level), near(of_all));
            }
        }
        assert_eq!(figures.lines().count(), all.lines().count());
    }
}

/// Figures of a process of this level; `None` where the processor cannot be made to look like one.
fn at_level(level: u32, dir: &Path) -> Option<String> {
    let path = dir.join(level.to_string());
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "figures_of_a_level", "--nocapture"]);
    command.env(LEVEL, level.to_string()).env(FIGURES, &path);
    if level < 3 {
        command.env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F");
    }
    let run = command.output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success(), "level {level}: {said}{}", String::from_utf8_lossy(&run.stderr));
    let figures = std::fs::read_to_string(path).ok();
    if figures.is_none() {
        println!("level {level} skipped: {said}");
    }
    figures
}

#[test]
fn figures_of_a_level() {
    let (Ok(level), Ok(path)) = (std::env::var(LEVEL), std::env::var(FIGURES)) else { return };
    if let Err(why) = pretend(level.parse().unwrap()) {
        println!("{why}");
        return;
    }
    let expected = match level.as_str() {
        "1" => [false; 3],
        "3" => [true, true, false],
        _ => [is_x86_feature_detected!("avx2"), is_x86_feature_detected!("fma"), is_x86_feature_detected!("avx512f")],
    };
    let seen = [is_x86_feature_detected!("avx2"), is_x86_feature_detected!("fma"), is_x86_feature_detected!("avx512f")];
    if level == "3" && !seen[0] {
        println!("the processor has no AVX2");
        return;
    }
    assert_eq!(seen, expected, "something asked what the processor has before it was hidden");
    let path = Path::new(&path);
    std::fs::write(path, figures(path.parent().unwrap())).unwrap();
}

/// What is calculated, a line each, with a recording in a folder; numbers as Rust's `{:?}` has them, which tells any two apart.
fn figures(dir: &Path) -> String {
    let mut all = String::new();
    let mut tell = |name: &str, what: &dyn std::fmt::Debug| writeln!(all, "{name}\t{what:?}").unwrap();
    let mut truth = arm::truth(ParameterSet::Compliance, 20);
    let backlash = Term::new("hidden", "hidden", Site::Joint { joint: 4 }, Basis::direction(4));
    truth.terms.push(Term { value: 2e-4, ..backlash });
    // joints by inverse kinematics, readings by the forward model
    let (touches, later) = (arm::touch(&truth, 120, 8e-6, 21), arm::touch(&truth, 60, 8e-6, 22));
    tell("touches", &[&touches, &later]);
    let (robot, cell, task) = (&truth.robot, &truth.cell, Task::silent());
    let options = Options::new(ParameterSet::Compliance);
    let calibration = calibrate(robot, cell, std::slice::from_ref(&touches), &options, &task).unwrap();
    tell("calibration", &calibration);
    let file = ModelFile::of_fit(&calibration.fitted);
    tell("model file", &file.to_toml().unwrap());
    tell("validation", &validate(robot, cell, &file, &[later], None, None).unwrap());
    // tracker points at the same joints, by themselves in a file
    let aims: Vec<_> = touches.rows.iter().map(|row| (row.state, Aim::Target(0))).collect();
    let points = simulate(&truth, &aims, &Scatter { length: 1e-5, angle: 0.0, seed: 3 }, None).unwrap();
    let path = dir.join("points.csv");
    write_csv(&points, &mut std::fs::File::create(&path).unwrap()).unwrap();
    let stream = CsvStream::open(&[path], 6).unwrap();
    tell("stream", &calibrate_stream(robot, cell, &stream, &options, &task).unwrap());
    let diagnosis = diagnose(robot, cell, &arm::build(touches), &trical_diagnose::Options::default(), &task).unwrap();
    tell("diagnosis", &diagnosis);
    all
}

/// Makes this process look as if its processor had the instructions of a level and no more: threads that it starts from now on, too.
fn pretend(level: u32) -> Result<(), String> {
    if level >= 4 {
        return Ok(());
    }
    HIDDEN.store(level, Ordering::SeqCst);
    // SAFETY: the handler touches the registers of the instruction that it answers for and nothing else
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = answer as *const () as usize;
        action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        if libc::sigaction(libc::SIGSEGV, &action, std::ptr::null_mut()) != 0 {
            return Err(std::io::Error::last_os_error().to_string());
        }
    }
    trap(true).map_err(|e| format!("this processor or system does not trap CPUID: {e}"))
}

static HIDDEN: AtomicU32 = AtomicU32::new(0);

fn trap(cpuid: bool) -> std::io::Result<()> {
    /// Of `asm/prctl.h`.
    const ARCH_SET_CPUID: libc::c_int = 0x1012;
    // SAFETY: the call has no effect on memory
    let failed = unsafe { libc::syscall(libc::SYS_arch_prctl, ARCH_SET_CPUID, libc::c_ulong::from(!cpuid)) };
    if failed == 0 { Ok(()) } else { Err(std::io::Error::last_os_error()) }
}

/// Answers CPUID without what is hidden; any other fault ends the process as it would without this.
extern "C" fn answer(_: libc::c_int, _: *mut libc::siginfo_t, context: *mut libc::c_void) {
    // SAFETY: the kernel hands over the registers of the thread, and the instruction that failed can be read where they say it is
    unsafe {
        let registers = &mut (*context.cast::<libc::ucontext_t>()).uc_mcontext.gregs;
        let at = registers[libc::REG_RIP as usize] as *const [u8; 2];
        if *at != [0x0f, 0xa2] || trap(false).is_err() {
            libc::signal(libc::SIGSEGV, libc::SIG_DFL);
            return;
        }
        let (leaf, part) = (registers[libc::REG_RAX as usize] as u32, registers[libc::REG_RCX as usize] as u32);
        let mut has = __cpuid_count(leaf, part);
        let bits = |numbers: &[u32]| !numbers.iter().fold(0_u32, |all, bit| all | 1 << bit);
        if HIDDEN.load(Ordering::SeqCst) < 3 {
            match (leaf, part) {
                // SSE3, PCLMULQDQ, SSSE3, FMA, SSE4, MOVBE, POPCNT, XSAVE, AVX, F16C
                (1, _) => has.ecx &= bits(&[0, 1, 9, 12, 19, 20, 22, 23, 26, 27, 28, 29]),
                // BMI1, AVX2, BMI2
                (7, 0) => has.ebx &= bits(&[3, 5, 8]),
                // LZCNT, XOP, FMA4
                (0x8000_0001, _) => has.ecx &= bits(&[5, 11, 16]),
                _ => {}
            }
        }
        match (leaf, part) {
            // AVX-512 and AMX of all kinds
            (7, 0) => {
                has.ebx &= bits(&[16, 17, 21, 26, 27, 28, 30, 31]);
                has.ecx &= bits(&[1, 6, 9, 10, 11, 12, 14]);
                has.edx &= bits(&[2, 3, 8, 22, 23, 24, 25]);
            }
            (7, _) => (has.eax, has.edx) = (0, 0),
            _ => {}
        }
        let told =
            [(libc::REG_RAX, has.eax), (libc::REG_RBX, has.ebx), (libc::REG_RCX, has.ecx), (libc::REG_RDX, has.edx)];
        for (register, value) in told {
            registers[register as usize] = i64::from(value);
        }
        registers[libc::REG_RIP as usize] += 2;
        if trap(true).is_err() {
            libc::abort();
        }
    }
}
