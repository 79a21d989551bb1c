//! Gauges by URL.

use std::time::Duration;

use super::line::{LINE_GAUGES, LineGauge, LineSettings};
use super::line_protocol::Pattern;
use super::port::open_port;
use super::uwave::{UWave, UWaveSettings};
use super::{AXES, Gauge, GaugeError, Mastered, Settle};
use crate::url::{DeviceUrl, UrlError};

/// Opens a gauge by its URL.
///
/// - `uwave:///dev/ttyUSB0?x=00&y=01&z=02&group=00`: Mitutoyo U-WAVE-R. A channel of another group is `x=03.00` (group,
///   channel). Further options: `flip` (axes that read with the opposite sign, e.g. `xz`), `timeout_ms`, `interval_ms`
///   (pause between requests), `attempts`, `unit=mm` (take values without a unit as mm), `clear=1` (the receiver forgets
///   what was read; not for measuring).
/// - the scheme of one of [`LINE_GAUGES`] (`itn://`, `line://`) and a port, or three ports `/dev/a,/dev/b,/dev/c` for x, y, z. Options: `baud`, `framing` (`8N1`), `request` (percent-encoded, e.g. `%3F%0D`), or `x`, `y`, `z` for a
///   request of each axis, `pattern` (`01A{v}`), `unit` (`mm`, `in`, `um`: of values that name none), `scale` (a factor
///   on it), `flip`, `timeout_ms`, `attempts`.
///
/// A port is `/dev/ttyUSB0`, `COM3`, or `HOST:PORT` of a serial device server in the network.
///
/// All take `settle_ms` (pause between the readings that must agree), `repeats` (how many of them), `settle_um` (how
/// much they may differ) and `zero_mm=x,y,z` (what the gauge shows on the calibrator; it is taken off every reading).
///
/// # Errors
/// A URL that cannot be used, or a port that cannot be opened.
pub fn open_gauge(url: &str) -> Result<Box<dyn Gauge>, GaugeError> {
    let mut url = DeviceUrl::parse(url)?;
    let zero = zero(&mut url)?;
    let gauge = open_bare(url)?;
    Ok(match zero {
        Some(zero) => Box::new(Mastered { gauge, zero }),
        None => gauge,
    })
}

/// The URL of the same gauge with another reading on the calibrator, m.
#[must_use]
pub fn with_zero(url: &str, zero: [f64; 3]) -> String {
    let bare = bare_url(url);
    let [x, y, z] = zero.map(|v| v * 1e3);
    format!("{bare}{}zero_mm={x:.4},{y:.4},{z:.4}", if bare.contains('?') { '&' } else { '?' })
}

/// The URL without a mastering.
#[must_use]
pub fn bare_url(url: &str) -> String {
    let (place, query) = url.split_once('?').unwrap_or((url, ""));
    let parts: Vec<&str> = query.split('&').filter(|p| !p.is_empty() && !p.starts_with("zero_mm=")).collect();
    if parts.is_empty() { place.to_owned() } else { format!("{place}?{}", parts.join("&")) }
}

fn zero(url: &mut DeviceUrl) -> Result<Option<[f64; 3]>, UrlError> {
    let Some(text) = url.take("zero_mm") else { return Ok(None) };
    let numbers: Vec<f64> = text.split(',').filter_map(|v| v.trim().parse().ok()).collect();
    match numbers.as_slice() {
        [x, y, z] if text.split(',').count() == 3 && numbers.iter().all(|v: &f64| v.abs() <= 100.0) => {
            Ok(Some([x * 1e-3, y * 1e-3, z * 1e-3]))
        }
        _ => Err(url.error(format!("option zero_mm={text:?}; expected three numbers of mm, as in 0.012,-0.3,0"))),
    }
}

fn open_bare(mut url: DeviceUrl) -> Result<Box<dyn Gauge>, GaugeError> {
    if url.scheme == "uwave" {
        let settings = uwave_settings(&mut url)?;
        let port = open_port(&url.place, &UWaveSettings::serial())?;
        return Ok(Box::new(UWave::new(port, format!("uwave {}", url.place), settings)));
    }
    let Some(preset) = LineSettings::preset(&url.scheme) else {
        let known = LINE_GAUGES.iter().map(|kind| kind.scheme).collect::<Vec<_>>().join(", ");
        return Err(url.error(format!("unknown gauge {:?}; known are uwave, {known}", url.scheme)).into());
    };
    let settings = line_settings(&mut url, preset)?;
    let places: Vec<&str> = url.place.split(',').collect();
    if !matches!(places.len(), 1 | 3) {
        return Err(url.error(format!("{} ports; expected one, or three for x, y, z", places.len())).into());
    }
    if places.len() == 3 && settings.pattern.values() == 3 {
        return Err(url.error("three ports and a pattern with three values; expected one of the two").into());
    }
    if places.len() == 1
        && settings.pattern.values() == 1
        && settings.requests[0] == settings.requests[1]
        && settings.requests[1] == settings.requests[2]
    {
        return Err(url
            .error(
                "one port, one request and one value give one axis; expected three ports, x=, y=, z= requests, or a \
                 pattern with three {v}",
            )
            .into());
    }
    let ports = places.into_iter().map(|place| open_port(place, &settings.serial)).collect::<Result<Vec<_>, _>>()?;
    Ok(Box::new(LineGauge::new(ports, format!("{} {}", url.scheme, url.place), settings)?))
}

pub(super) fn uwave_settings(url: &mut DeviceUrl) -> Result<UWaveSettings, UrlError> {
    let group = url.take("group").map_or(Ok(0), |value| two_digits(url, "group", &value))?;
    let mut settings = UWaveSettings { groups: [group; 3], ..UWaveSettings::default() };
    for (axis, (channel, group)) in AXES.iter().zip(settings.channels.iter_mut().zip(&mut settings.groups)) {
        let Some(value) = url.take(&axis.to_string()) else { continue };
        let (own, number) = value.split_once('.').map_or((None, value.as_str()), |(g, c)| (Some(g), c));
        *channel = two_digits(url, &axis.to_string(), number)?;
        if let Some(own) = own {
            *group = two_digits(url, &axis.to_string(), own)?;
        }
    }
    let places: Vec<(u8, u8)> = settings.groups.into_iter().zip(settings.channels).collect();
    if let [x, y, z] = places[..]
        && (x == y || y == z || x == z)
    {
        let names: Vec<String> = AXES.iter().zip(&places).map(|(a, (g, c))| format!("{a}={g:02}.{c:02}")).collect();
        return Err(url.error(format!("channels {}; expected three different ones", names.join(", "))));
    }
    settings.flip = flip(url)?;
    settings.timeout = milliseconds(url, "timeout_ms", settings.timeout)?;
    settings.interval = milliseconds(url, "interval_ms", settings.interval)?;
    settings.attempts = url.take_number("attempts", f64::from(settings.attempts), 1.0..=100.0)? as u32;
    settings.assume_mm = match url.take("unit").as_deref() {
        None => false,
        Some("mm") => true,
        Some(other) => return Err(url.error(format!("option unit={other:?}; expected mm"))),
    };
    settings.clear = match url.take("clear").as_deref() {
        None | Some("0") => false,
        Some("1") => true,
        Some(other) => return Err(url.error(format!("option clear={other:?}; expected 0 or 1"))),
    };
    settings.settle = settle(url, settings.settle)?;
    url.finish(
        "x, y, z, group, flip, timeout_ms, interval_ms, attempts, clear, unit, settle_ms, repeats, settle_um, zero_mm",
    )?;
    Ok(settings)
}

pub(super) fn line_settings(url: &mut DeviceUrl, mut settings: LineSettings) -> Result<LineSettings, UrlError> {
    settings.serial.baud = url.take_number("baud", f64::from(settings.serial.baud), 50.0..=4_000_000.0)? as u32;
    if let Some(framing) = url.take("framing") {
        settings.serial = settings
            .serial
            .with_framing(&framing)
            .ok_or_else(|| url.error(format!("option framing={framing:?}; expected e.g. 8N1 or 7E2")))?;
    }
    if let Some(request) = url.take("request") {
        settings.requests = std::array::from_fn(|_| request.clone());
    }
    for (axis, request) in AXES.iter().zip(&mut settings.requests) {
        if let Some(own) = url.take(&axis.to_string()) {
            *request = own;
        }
    }
    if let Some(pattern) = url.take("pattern") {
        settings.pattern = Pattern::parse(&pattern)
            .ok_or_else(|| url.error(format!("option pattern={pattern:?}; expected one or three {{v}} in it")))?;
    }
    if let Some(unit) = url.take("unit") {
        settings.scale = match unit.as_str() {
            "mm" => 1e-3,
            "um" => 1e-6,
            "in" => 25.4e-3,
            _ => return Err(url.error(format!("option unit={unit:?}; expected mm, um or in"))),
        };
    }
    let scale = url.take_number("scale", 1.0, -1e6..=1e6)?;
    if scale == 0.0 {
        return Err(url.error("option scale=0; expected a factor that leaves something of a reading"));
    }
    settings.scale *= scale;
    settings.flip = flip(url)?;
    settings.timeout = milliseconds(url, "timeout_ms", settings.timeout)?;
    settings.attempts = url.take_number("attempts", f64::from(settings.attempts), 1.0..=100.0)? as u32;
    settings.settle = settle(url, settings.settle)?;
    url.finish(
        "baud, framing, request, x, y, z, pattern, unit, scale, flip, timeout_ms, attempts, settle_ms, repeats, settle_um, zero_mm",
    )?;
    Ok(settings)
}

fn two_digits(url: &DeviceUrl, key: &str, value: &str) -> Result<u8, UrlError> {
    value
        .parse::<u8>()
        .ok()
        .filter(|number| *number <= 99)
        .ok_or_else(|| url.error(format!("option {key}={value:?}; expected a number from 00 to 99")))
}

fn flip(url: &mut DeviceUrl) -> Result<[bool; 3], UrlError> {
    let letters = url.take("flip").unwrap_or_default();
    if letters.chars().any(|letter| !AXES.contains(&letter)) {
        return Err(url.error(format!("option flip={letters:?}; expected letters of xyz")));
    }
    Ok(AXES.map(|axis| letters.contains(axis)))
}

fn settle(url: &mut DeviceUrl, default: Settle) -> Result<Settle, UrlError> {
    Ok(Settle {
        interval: milliseconds(url, "settle_ms", default.interval)?,
        repeats: url.take_number("repeats", default.repeats as f64, 2.0..=100.0)? as usize,
        tolerance: url.take_number("settle_um", default.tolerance * 1e6, 0.0..=1000.0)? * 1e-6,
        timeout: default.timeout,
    })
}

fn milliseconds(url: &mut DeviceUrl, key: &str, default: Duration) -> Result<Duration, UrlError> {
    let number = url.take_number(key, default.as_secs_f64() * 1e3, 0.0..=600_000.0)?;
    Ok(Duration::from_micros((number * 1e3) as u64))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn says(url: &str) -> String {
        match open_gauge(url) {
            Ok(_) => "opened".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_bad_url_is_one_clear_sentence() {
        assert!(says("uwave:///dev/ttyUSB0?chanel=1").contains("unknown option \"chanel\""));
        assert!(says("uwave:///dev/ttyUSB0?x=100").contains("x=\"100\"; expected a number from 00 to 99"));
        assert!(says("uwave:///dev/ttyUSB0?x=01").contains("three different"));
        assert!(says("usb:///dev/ttyUSB0").contains("unknown gauge \"usb\""));
        assert!(says("itn:///dev/a").contains("three ports"));
        assert!(says("itn:///dev/a,/dev/b").contains("2 ports"));
        assert!(says("opto:///dev/a,/dev/b,/dev/c?framing=8M1").contains("8N1"));
        assert!(says("line:///dev/a?pattern=abc").contains("{v}"));
        assert!(says("line:///dev/a?pattern={v};{v};{v}&scale=0").contains("scale=0"));
        assert!(says("uwave:///dev/does-not-exist").contains("cannot be opened"));
        assert!(says("uwave:///dev/a?zero_mm=1,2").contains("three numbers of mm"));
        assert!(says("uwave:///dev/a?zero_mm=1,2,nan").contains("three numbers of mm"));
    }

    #[test]
    fn a_mastered_url_keeps_its_other_options() {
        let url = with_zero("uwave:///dev/a?x=03&zero_mm=1,1,1&flip=x", [1e-3, -0.25e-3, 0.0]);
        assert_eq!(url, "uwave:///dev/a?x=03&flip=x&zero_mm=1.0000,-0.2500,0.0000");
        assert_eq!(with_zero("pico:///dev/a", [0.0; 3]), "pico:///dev/a?zero_mm=0.0000,0.0000,0.0000");
        let mut parsed = DeviceUrl::parse(&url).unwrap();
        assert_eq!(zero(&mut parsed).unwrap(), Some([1e-3, -0.25e-3, 0.0]));
    }

    #[test]
    fn settings_come_from_the_url() {
        let mut url =
            DeviceUrl::parse("uwave:///dev/x?x=07&y=08&z=09&group=02&flip=xz&interval_ms=0&timeout_ms=50").unwrap();
        let settings = uwave_settings(&mut url).unwrap();
        assert_eq!((settings.channels, settings.groups, settings.flip), ([7, 8, 9], [2; 3], [true, false, true]));
        let mut two = DeviceUrl::parse("uwave:///dev/x?group=01&x=00&y=03.00&z=02").unwrap();
        let settings_of_two = uwave_settings(&mut two).unwrap();
        assert_eq!((settings_of_two.channels, settings_of_two.groups), ([0, 0, 2], [1, 3, 1]));
        assert_eq!((settings.interval, settings.timeout), (Duration::ZERO, Duration::from_millis(50)));
        let mut url =
            DeviceUrl::parse("line:///dev/x?baud=19200&framing=7E1&x=A%0D&y=B%0D&z=C%0D&unit=in&scale=2").unwrap();
        let settings = line_settings(&mut url, LineSettings::preset("line").unwrap()).unwrap();
        assert_eq!(settings.serial.baud, 19200);
        assert_eq!(settings.requests, ["A\r", "B\r", "C\r"]);
        assert!((settings.scale - 0.0508).abs() < 1e-12);
    }

    #[test]
    fn every_kind_of_line_gauge_opens_by_its_scheme_and_is_named_where_one_is_unknown() {
        let said = open_gauge("foo:///dev/none").err().map(|e| e.to_string()).unwrap_or_default();
        for kind in LINE_GAUGES {
            assert!(said.contains(&format!(" {}", kind.scheme)), "{said}");
            assert!(LineSettings::preset(kind.scheme).is_some_and(|s| s.pattern.values() == 1), "{}", kind.scheme);
            assert_eq!(LINE_GAUGES.iter().filter(|k| k.scheme == kind.scheme).count(), 1);
            let absent = open_gauge(&format!("{}:///dev/none,/dev/none,/dev/none", kind.scheme));
            assert!(matches!(absent, Err(GaugeError::Open { .. })), "{}", kind.scheme);
        }
    }
}
