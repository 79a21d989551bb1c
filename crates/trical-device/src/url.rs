//! The small URL grammar of `--gauge` and `--controller`: `scheme://place?key=value&key=value`.
//!
//! Not by the crate `url`: it reads URLs as browsers do. A `#` in a path would begin a fragment, `COM3,COM4` and a path of Windows would be
//! hosts that it judges, `..` would be resolved, and a broken `%` escape would pass; it and its rules for names of hosts are 26 packages more.

use std::borrow::Cow;

use thiserror::Error;
use trical_model::error::shortened;

/// A URL that cannot be used, as one sentence.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{:?}: {}", shortened(url, 200), shortened(problem, 400))]
pub struct UrlError {
    /// The URL as it was given, without secrets.
    pub url: String,
    /// What was found and what was expected.
    pub problem: String,
}

/// Options whose values are shown and recorded nowhere.
const SECRETS: [&str; 2] = ["password", "secret"];

/// A URL as it may be shown and recorded: values of `password` and `secret` are left out, and what stands before an `@`.
#[must_use]
pub fn without_secrets(text: &str) -> String {
    let hidden = |part: &str| match part.split_once('=') {
        Some((key, _)) if SECRETS.iter().any(|secret| key.eq_ignore_ascii_case(secret)) => format!("{key}=..."),
        _ => part.to_owned(),
    };
    let (place, query) = text.split_once('?').map_or((text, None), |(place, query)| (place, Some(query)));
    let place = match (place.split_once("://"), place.rsplit_once('@')) {
        (Some((scheme, _)), Some((_, host))) => format!("{scheme}://...@{host}"),
        _ => place.to_owned(),
    };
    match query {
        Some(query) => format!("{place}?{}", query.split('&').map(hidden).collect::<Vec<_>>().join("&")),
        None => place,
    }
}

/// A password or a shared secret. It is shown nowhere, not even by `{:?}`.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// A secret of which this is the text.
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }

    /// Its text, for who sends it.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.0
    }
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("...")
    }
}

/// A device URL in its parts; values are percent-decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceUrl {
    /// The URL as it was given, without secrets, for messages.
    pub text: String,
    /// What stands before `://`, in lower case.
    pub scheme: String,
    /// What stands between `://` and `?`: a path or `host:port`.
    pub place: String,
    query: Vec<(String, String)>,
}

impl DeviceUrl {
    /// Splits a URL.
    ///
    /// # Errors
    /// No `://`, an empty place, a key without `=`, a key given twice, a broken percent escape.
    pub fn parse(text: &str) -> Result<Self, UrlError> {
        let fail = |problem: String| UrlError { url: without_secrets(text), problem };
        let (scheme, rest) = text
            .split_once("://")
            .ok_or_else(|| fail("no \"://\" in it; expected scheme://place, as in uwave:///dev/ttyUSB0 (a gauge) or rapid://192.168.125.1:5000 (a controller)".to_owned()))?;
        let (place, query) = match rest.split_once('?') {
            Some((place, query)) => (place, query),
            None => (rest, ""),
        };
        if place.is_empty() {
            return Err(fail("nothing between \"://\" and the options; expected a port or an address".to_owned()));
        }
        let mut pairs: Vec<(String, String)> = Vec::new();
        for part in query.split('&').filter(|part| !part.is_empty()) {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| fail(format!("option {part:?} has no \"=\"; expected key=value")))?;
            if pairs.iter().any(|(known, _)| known == key) {
                return Err(fail(format!("option {key:?} is given twice")));
            }
            let value = percent_decode(value)
                .ok_or_else(|| fail(format!("option {key:?} has a broken percent escape in its value")))?;
            pairs.push((key.to_owned(), value));
        }
        let place = percent_decode(place).ok_or_else(|| fail("broken percent escape in the place".to_owned()))?;
        if place.contains('@') && !place.starts_with('/') {
            return Err(fail("a user before an \"@\"; expected options behind a \"?\"".to_owned()));
        }
        Ok(Self { text: without_secrets(text), scheme: scheme.to_ascii_lowercase(), place, query: pairs })
    }

    /// An error about this URL.
    #[must_use]
    pub fn error(&self, problem: impl Into<String>) -> UrlError {
        UrlError { url: self.text.clone(), problem: problem.into() }
    }

    /// Takes the text value of a key out of the URL; what is left at the end is unknown (see [`Self::finish`]).
    pub fn take(&mut self, key: &str) -> Option<String> {
        let at = self.query.iter().position(|(known, _)| known == key)?;
        Some(self.query.remove(at).1)
    }

    /// Takes a secret out of the URL: `key=TEXT`, or `key=@FILE` for the first line of a file, which leaves no trace in a
    /// shell's history.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn take_secret(&mut self, key: &str) -> Result<Option<Secret>, UrlError> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let Some(path) = value.strip_prefix('@') else { return Ok(Some(Secret(value))) };
        let text = trical_model::error::read_text(std::path::Path::new(path)).map_err(|e| self.error(e.to_string()))?;
        Ok(Some(Secret(text.lines().next().unwrap_or_default().trim().to_owned())))
    }

    /// Takes a number out of the URL, or `default`.
    ///
    /// # Errors
    /// The value is not a number within `range`.
    pub fn take_number(
        &mut self,
        key: &str,
        default: f64,
        range: std::ops::RangeInclusive<f64>,
    ) -> Result<f64, UrlError> {
        let Some(value) = self.take(key) else { return Ok(default) };
        match value.parse::<f64>() {
            Ok(number) if range.contains(&number) => Ok(number),
            _ => Err(self.error(format!(
                "option {key}={value:?}; expected a number from {} to {}",
                range.start(),
                range.end()
            ))),
        }
    }

    /// All keys must have been taken.
    ///
    /// # Errors
    /// Names the first key that nobody took, and the keys that are known.
    pub fn finish(&self, known: &str) -> Result<(), UrlError> {
        match self.query.first() {
            None => Ok(()),
            Some((key, _)) => Err(self.error(format!("unknown option {key:?}; known are {known}"))),
        }
    }
}

/// `None` for a percent sign without two hexadecimal digits behind it (which percent_encoding would leave as it is), and for
/// bytes that are no text.
fn percent_decode(text: &str) -> Option<String> {
    let digits = |after: &[u8]| after.get(..2).is_some_and(|d| d.iter().all(u8::is_ascii_hexdigit));
    let whole = text.as_bytes().split(|b| *b == b'%').skip(1).all(digits);
    percent_encoding::percent_decode_str(text).decode_utf8().ok().filter(|_| whole).map(Cow::into_owned)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_password_is_in_no_message() {
        let url = "rws://host?user=me&password=s3cret&unit=ROB_1";
        assert_eq!(without_secrets(url), "rws://host?user=me&password=...&unit=ROB_1");
        assert_eq!(without_secrets("rapid://host:5000"), "rapid://host:5000");
        let error = DeviceUrl::parse(url).unwrap().error("wrong").to_string();
        assert!(!error.contains("s3cret") && error.contains("user=me"), "{error}");
        for url in [
            "rapid://h?secret=s3cret&x",
            "rws://h?Password=s3cret&x",
            "rws://me:s3cret@h?x=%",
            "rws://h?password=s3cret%2",
        ] {
            let error = DeviceUrl::parse(url).unwrap_err().to_string();
            assert!(!error.contains("s3cret"), "{error}");
        }
        assert_eq!(format!("{:?}", Secret::new("s3cret")), "...");
    }

    #[test]
    fn a_secret_may_stand_in_a_file() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "s3cret word\nmore\n").unwrap();
        let mut url = DeviceUrl::parse(&format!("rapid://h?secret=@{}&password=p", file.path().display())).unwrap();
        assert_eq!(url.take_secret("secret").unwrap().unwrap().text(), "s3cret word");
        assert_eq!(url.take_secret("password").unwrap().unwrap().text(), "p");
        assert_eq!(url.take_secret("password").unwrap(), None);
        let mut url = DeviceUrl::parse("rapid://h?secret=@/no/such").unwrap();
        assert!(url.take_secret("secret").unwrap_err().to_string().contains("/no/such"));
    }

    #[test]
    fn parts_and_escapes() {
        let mut url = DeviceUrl::parse("line:///dev/ttyS0?request=%3F%0D&baud=4800").unwrap();
        assert_eq!((url.scheme.as_str(), url.place.as_str()), ("line", "/dev/ttyS0"));
        assert_eq!(url.take("request").unwrap(), "?\r");
        assert_eq!(DeviceUrl::parse("line:///a%C3%A4#1,%25/b?x=1").unwrap().place, "/aä#1,%/b");
        assert_eq!(url.take_number("baud", 9600.0, 50.0..=1e6).unwrap(), 4800.0);
        url.finish("baud, request").unwrap();
    }

    #[test]
    fn errors_name_what_is_wrong() {
        let says = |text: &str| DeviceUrl::parse(text).unwrap_err().to_string();
        assert!(says("ttyUSB0").contains("://"));
        assert!(says("line://?x=1").contains("nothing between"));
        assert!(says("line:///dev/a?x").contains("no \"=\""));
        assert!(says("line:///dev/a?x=1&x=2").contains("twice"));
        for broken in ["%2", "%", "%%41", "%4g", "%+4", "a%C3"] {
            assert!(says(&format!("line:///dev/a?x={broken}")).contains("percent"), "{broken}");
            assert!(says(&format!("line:///dev/{broken}")).contains("percent"), "{broken}");
        }
        let url = DeviceUrl::parse("line:///dev/a?speling=1").unwrap();
        assert_eq!(
            url.finish("baud").unwrap_err().to_string(),
            "\"line:///dev/a?speling=1\": unknown option \"speling\"; known are baud"
        );
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_refused_or_taken_without_a_panic(text in ".*") {
            let _ = DeviceUrl::parse(&text);
        }
    }
}
