//! Dates as videos state them.

/// `2020-03-30T20:01:38.000000Z` in microseconds since the Unix epoch; none for any other form.
pub(super) fn epoch_us(text: &str) -> Option<i64> {
    let (date, time) = text.strip_suffix('Z')?.split_once('T')?;
    let [year, month, day] = numbers(date, '-')?;
    let (clock, fraction) = time.split_once('.').unwrap_or((time, "0"));
    let [hour, minute, second] = numbers(clock, ':')?;
    let is_date = (1..=9999).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    let is_time = hour < 24 && minute < 60 && second <= 60;
    let digits: String = fraction.chars().chain("000000".chars()).take(6).collect();
    let micros: i64 = digits.bytes().all(|c| c.is_ascii_digit()).then(|| digits.parse().ok())??;
    let seconds = days_since_epoch(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second;
    (is_date && is_time).then_some(seconds * 1_000_000 + micros)
}

/// Three numbers without sign.
fn numbers(text: &str, between: char) -> Option<[i64; 3]> {
    let part = |part: &str| Some(i64::from(part.parse::<u16>().ok()?));
    let parts: Option<Vec<i64>> = text.split(between).map(part).collect();
    parts?.try_into().ok()
}

/// Days from 1970-01-01 in the Gregorian calendar, by counting years from March, so that the leap day is the last.
const fn days_since_epoch(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let from_march = (month + 9) % 12;
    let days_before_month = (153 * from_march + 2) / 5;
    365 * year + year / 4 - year / 100 + year / 400 + days_before_month + day - 1 - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        // From `date --utc --date=... +%s`.
        for (text, seconds) in [
            ("1970-01-01T00:00:00.000000Z", 0),
            ("2020-03-30T20:01:38.000000Z", 1_585_598_498),
            ("2000-02-29T23:59:59Z", 951_868_799),
            ("2024-12-31T00:00:00Z", 1_735_603_200),
            ("1904-01-01T00:00:00Z", -2_082_844_800),
        ] {
            assert_eq!(epoch_us(text), Some(seconds * 1_000_000), "{text}");
        }
        assert_eq!(epoch_us("2020-03-30T20:01:38.25Z"), Some(1_585_598_498_250_000));
    }

    #[test]
    fn other_texts_are_no_dates() {
        for text in
            ["", "yesterday", "2020-03-30", "2020-13-01T00:00:00Z", "2020-01-01T24:00:00Z", "2020-03-30T20:01:38.xZ"]
        {
            assert_eq!(epoch_us(text), None, "{text}");
        }
    }
}
