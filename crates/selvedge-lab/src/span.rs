//! Spans of time as people write them: `90s`, `30m`, `2h`, `1h30m`.

use std::time::Duration;

use anyhow::{Result, anyhow};

/// Reads a span of whole hours, minutes and seconds, each at most once and in this order.
pub fn parse(text: &str) -> Result<Duration> {
    let wrong = || anyhow!("{text:?} is no span of time: write 90s, 30m, 2h or 1h30m");
    let (mut seconds, mut digits, mut units) = (0_u64, String::new(), "hms".chars());
    for character in text.chars() {
        if character.is_ascii_digit() {
            digits.push(character);
            continue;
        }
        units.find(|unit| *unit == character).ok_or_else(wrong)?;
        let scale = match character {
            'h' => 3600,
            'm' => 60,
            _ => 1,
        };
        let part: u64 = digits.parse().map_err(|_| wrong())?;
        let part = part.checked_mul(scale).ok_or_else(wrong)?;
        seconds = seconds.checked_add(part).ok_or_else(wrong)?;
        digits.clear();
    }
    if seconds == 0 || !digits.is_empty() {
        return Err(wrong());
    }
    Ok(Duration::from_secs(seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_people_write() {
        for (text, seconds) in [("90s", 90), ("30m", 1800), ("1h30m", 5400), ("1h2s", 3602)] {
            assert_eq!(parse(text).unwrap().as_secs(), seconds, "{text}");
        }
    }

    #[test]
    fn refuses_the_rest() {
        let too_long = "99999999999999999999s";
        for text in [
            "", "30", "m", "0s", "5m1h", "5m5m", "1.5h", "-3s", "3 m", too_long,
        ] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
