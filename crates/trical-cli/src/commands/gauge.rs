//! `trical gauge`: for a person with a cable in hand.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clap::Subcommand;
use serde_json::json;
use trical_device::gauge::trial::{Trial, master, stem_answers, trial};
use trical_device::gauge::{AXES, LINE_GAUGES, LineKind, list_ports};
use trical_device::{Gauge, GaugeError, open_gauge};
use trical_report::table;

use crate::error::{CliError, Result};
use crate::{interrupt, quoted, say, say_json, say_lines};

/// Arguments of `trical gauge`.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// The serial ports of this computer, and which of them are gauges
    List {
        /// A machine-readable list on standard output
        #[arg(long)]
        json: bool,
    },
    /// Show the three indicators until Ctrl-C
    #[command(after_help = urls())]
    Watch {
        #[command(flatten)]
        link: Link,
        /// Stop after so many readings
        #[arg(long, value_name = "N")]
        count: Option<u64>,
        /// Pause between readings
        #[arg(long, value_name = "MS", default_value_t = 200)]
        every_ms: u64,
        /// One JSON object a reading
        #[arg(long)]
        json: bool,
    },
    /// What the device says of itself, how fast it answers and how still it stands
    #[command(after_help = urls())]
    Test {
        #[command(flatten)]
        link: Link,
        /// How many readings
        #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(2..=10_000))]
        count: u64,
        /// Ask to push each stem in turn, and say whether its axis answers
        #[arg(long)]
        stems: bool,
        /// How long to wait for a stem
        #[arg(long, value_name = "S", default_value_t = 60.0, requires = "stems")]
        wait_s: f64,
        /// A machine-readable summary on standard output
        #[arg(long)]
        json: bool,
    },
    /// Master the device: with all stems on the calibrator, read what it shows there and print the URL to use from now on
    #[command(after_help = urls())]
    Zero {
        #[command(flatten)]
        link: Link,
        /// A machine-readable summary on standard output
        #[arg(long)]
        json: bool,
    },
}

/// What `--gauge` takes.
fn urls() -> String {
    let kind = |kind: &LineKind| format!("\n  {:<36}  {}", format!("{}://PORT,PORT,PORT", kind.scheme), kind.device);
    format!(
        "Gauges:
  uwave:///dev/ttyUSB0?x=00&y=01&z=02   Mitutoyo U-WAVE-R; &group=03, or x=03.00 (group, channel){}
One port will do where it answers three values, as in line://PORT?request=%3F%0D&pattern={{v}};{{v}};{{v}}
{OPTIONS}",
        LINE_GAUGES.iter().map(kind).collect::<String>()
    )
}

const OPTIONS: &str = "Options of all: flip=xz, settle_ms, repeats, settle_um, timeout_ms, attempts, zero_mm=x,y,z
  uwave:  interval_ms, unit=mm, clear=1 (not for measuring)
  others: baud, framing=7E2, x=, y=, z= (a request for each axis), unit=mm|um|in, scale
More: docs/cell.md";

/// The gauge.
#[derive(clap::Args)]
pub struct Link {
    /// The gauge, one of those below, e.g. uwave:///dev/ttyUSB0?x=00&y=01&z=02
    #[arg(long, value_name = "URL")]
    gauge: String,
}

impl Link {
    fn open(&self) -> Result<Box<dyn Gauge>> {
        Ok(open_gauge(&self.gauge)?)
    }
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    match &args.what {
        What::List { json } => list(*json),
        What::Watch { link, count, every_ms, json } => {
            watch(link.open()?.as_mut(), *count, Duration::from_millis(*every_ms), *json)
        }
        What::Test { link, count, stems, wait_s, json } => {
            let wait = stems.then(|| Duration::try_from_secs_f64(*wait_s).unwrap_or(Duration::from_secs(60)));
            test(link.open()?.as_mut(), *count, wait, *json)
        }
        What::Zero { link, json } => zero(link, *json),
    }
}

fn list(as_json: bool) -> Result<()> {
    let ports = list_ports().map_err(CliError::failed)?;
    if as_json {
        let ports: Vec<_> = ports.iter().map(|p| json!({ "port": p.path, "device": p.device, "url": p.url })).collect();
        return say_json(&json!({ "ports": ports }));
    }
    if ports.is_empty() {
        say(
            "No serial port was found. Is the cable in? On Linux the U-WAVE-R (USB 0FE7:2002) is an FTDI chip whose number",
        )?;
        return say(
            "the driver may not know: as root, modprobe ftdi_sio; echo 0fe7 2002 > /sys/bus/usb-serial/drivers/ftdi_sio/new_id",
        );
    }
    let mut rows = vec![["port", "device", "try"].map(String::from).to_vec()];
    rows.extend(ports.into_iter().map(|p| vec![p.path, p.device, p.url.unwrap_or_default()]));
    say_lines(table::lines(&rows))?;
    Ok(())
}

fn warn(gauge: &mut dyn Gauge) -> Vec<String> {
    let warnings = gauge.take_warnings();
    for w in &warnings {
        crate::note!("trical: note: {w}");
    }
    warnings
}

/// The three indicators for people.
pub fn shown(reading: &[f64; 3]) -> String {
    let parts: Vec<String> = AXES.iter().zip(reading).map(|(a, v)| format!("{a} {:+9.4}", v * 1e3)).collect();
    format!("{} mm", parts.join("   "))
}

fn watch(gauge: &mut dyn Gauge, count: Option<u64>, every: Duration, as_json: bool) -> Result<()> {
    let stop = interrupt::watch()?.asked;
    let begin = Instant::now();
    let mut shown_so_far = 0;
    let mut failures = 0;
    while count.is_none_or(|n| shown_so_far < n) && !stop.load(Ordering::Relaxed) {
        match gauge.read() {
            Ok(reading) => {
                failures = 0;
                let t = begin.elapsed().as_secs_f64();
                let [x, y, z] = reading.map(|v| (v * 1e9).round() * 1e-6);
                say(if as_json {
                    json!({ "t_s": (t * 1e3).round() * 1e-3, "ix_mm": x, "iy_mm": y, "iz_mm": z }).to_string()
                } else {
                    format!("{t:8.2} s   {}", shown(&reading))
                })?;
                shown_so_far += 1;
            }
            // someone may be plugging a cable: say so and go on, but not for ever
            Err(e @ (GaugeError::Io { .. } | GaugeError::Open { .. })) => return Err(CliError::failed(e)),
            Err(e) => {
                failures += 1;
                if failures >= 5 || count.is_some() {
                    return Err(CliError::failed(e));
                }
                crate::note!("trical: note: {e}");
            }
        }
        warn(gauge);
        if count != Some(shown_so_far) {
            std::thread::sleep(every);
        }
    }
    Ok(())
}

fn test(gauge: &mut dyn Gauge, count: u64, stems: Option<Duration>, as_json: bool) -> Result<()> {
    let stop = interrupt::watch()?.asked;
    let Trial { says: about, seconds_each: each, axes, .. } =
        trial(gauge, usize::try_from(count).unwrap_or(usize::MAX), &stop).map_err(CliError::failed)?;
    if !as_json {
        say(format!("gauge {}", gauge.name()))?;
        for line in &about {
            say(format!("  {line}"))?;
        }
        say(format!("{count} readings of all three axes, {:.0} ms each", each * 1e3))?;
        let mut rows = vec![["axis", "mean mm", "sd mm", "range mm", "smallest step mm"].map(String::from).to_vec()];
        rows.extend(AXES.iter().zip(&axes).map(|(a, x)| {
            vec![
                a.to_string(),
                format!("{:+.4}", x.mean * 1e3),
                format!("{:.4}", x.sd * 1e3),
                format!("{:.4}", x.spread * 1e3),
                x.step.map_or_else(|| "-".to_owned(), |s| format!("{:.4}", s * 1e3)),
            ]
        }));
        say_lines(table::lines(&rows))?;
        if axes.iter().all(|a| a.spread == 0.0) {
            say("All readings are the same: right if nothing moved; --stems shows whether they follow the stems.")?;
        }
    }
    let mut answered = Vec::new();
    if let Some(wait) = stems {
        for (k, name) in AXES.iter().enumerate() {
            crate::note!("Push the stem along {name} in by a few mm, and only that one; then let it go.");
            answered.push(stem_answers(gauge, k, wait, &stop).map_err(CliError::failed)? * 1e3);
            if !as_json {
                say(format!("axis {name} answers"))?;
            }
        }
    }
    let warnings = warn(gauge);
    if as_json {
        let axes: Vec<_> = AXES
            .iter()
            .zip(&axes)
            .map(|(a, x)| {
                json!({ "axis": a, "mean_mm": x.mean * 1e3, "sd_mm": x.sd * 1e3, "spread_mm": x.spread * 1e3,
                        "step_mm": x.step.map(|s| s * 1e3) })
            })
            .collect();
        say_json(&json!({ "gauge": gauge.name(), "says": about, "readings": count, "seconds_each": each,
                            "axes": axes, "stems_mm": answered, "warnings": warnings }))?;
    }
    Ok(())
}

fn zero(link: &Link, as_json: bool) -> Result<()> {
    let stop = interrupt::watch()?.asked;
    let mastered = master(&link.gauge, &stop).map_err(|e| match e {
        GaugeError::Url(_) | GaugeError::Open { .. } => CliError::Input(e.to_string()),
        e => CliError::failed(e),
    })?;
    for w in &mastered.warnings {
        crate::note!("trical: note: {w}");
    }
    let (zero, url) = (mastered.zero, mastered.url);
    if as_json {
        return say_json(&json!({ "zero_mm": zero.map(|v| v * 1e3), "gauge": url, "warnings": mastered.warnings }));
    }
    say(format!("On the calibrator the gauge shows {}. From now on use", shown(&zero)))?;
    say(format!("--gauge {}", quoted(&url)))
}
