//! Layers of settings.

use std::fmt;

use toml::{Table, Value};

use super::Settings;

/// A setting that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SettingFault {
    /// The setting, or the variable that sets it.
    pub setting: String,
    /// What is wrong.
    pub problem: String,
}

impl fmt::Display for SettingFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.setting, self.problem)
    }
}

/// The settings of a file's text, then of `SKYPOSE_*` variables (`SKYPOSE_HTTP_LISTEN` sets `listen` in `[http]`), then of
/// options as `("http.listen", value)`.
///
/// # Errors
/// Every fault there is.
pub fn load(
    file: Option<&str>,
    variables: impl IntoIterator<Item = (String, String)>,
    options: &[(&str, String)],
) -> Result<Settings, Vec<SettingFault>> {
    let mut layers = Layers::new();
    if let Some(text) = file {
        layers.add_file(text);
    }
    let mut variables: Vec<(String, String)> =
        variables.into_iter().filter(|(name, _)| name.starts_with("SKYPOSE_")).collect();
    variables.sort();
    for (name, text) in variables {
        layers.add_variable(&name, &text);
    }
    for (setting, text) in options {
        layers.set_text(setting, setting, text);
    }
    layers.finish()
}

struct Layers {
    merged: Table,
    faults: Vec<SettingFault>,
}

impl Layers {
    fn new() -> Self {
        let merged = Table::try_from(Settings::default()).unwrap_or_default();
        Self { merged, faults: Vec::new() }
    }

    fn fault(&mut self, setting: &str, problem: impl Into<String>) {
        self.faults.push(SettingFault { setting: setting.into(), problem: problem.into() });
    }

    fn add_file(&mut self, text: &str) {
        let table: Table = match text.parse() {
            Ok(table) => table,
            // Without the line itself, which may hold a password.
            Err(error) => {
                let line = error.span().map_or(0, |span| text[..span.start.min(text.len())].matches('\n').count());
                return self
                    .fault("settings file", format!("line {}: {}", line + 1, error.message().replace('\n', " ")));
            }
        };
        for (section, content) in table {
            let Value::Table(content) = content else {
                self.fault(&section, "settings stand in sections, as in [http]");
                continue;
            };
            for (key, value) in content {
                self.set(&format!("{section}.{key}"), &format!("{section}.{key}"), value);
            }
        }
    }

    /// The section is the longest known one that the name begins with: names have underscores of their own.
    fn add_variable(&mut self, name: &str, text: &str) {
        let rest = name["SKYPOSE_".len()..].to_lowercase();
        let section = self
            .merged
            .keys()
            .find(|section| rest.strip_prefix(section.as_str()).is_some_and(|key| key.starts_with('_')));
        match section {
            Some(section) => {
                let setting = format!("{section}.{}", &rest[section.len() + 1..]);
                self.set_text(name, &setting, text);
            }
            None => self.fault(name, "no such setting"),
        }
    }

    /// Text is read as what the setting's default is.
    fn set_text(&mut self, source: &str, setting: &str, text: &str) {
        let value = match self.slot(setting) {
            Some(Value::Integer(_)) => text.parse().map(Value::Integer).map_err(|_| "a whole number"),
            Some(Value::Float(_)) => text.parse().map(Value::Float).map_err(|_| "a number"),
            Some(Value::Boolean(_)) => text.parse().map(Value::Boolean).map_err(|_| "true or false"),
            _ => Ok(Value::String(text.into())),
        };
        match value {
            Ok(value) => self.set(source, setting, value),
            Err(needed) => self.fault(source, format!("{text:?} is not {needed}")),
        }
    }

    fn set(&mut self, source: &str, setting: &str, value: Value) {
        let Some(slot) = self.slot(setting) else {
            return self.fault(source, "no such setting");
        };
        let value = match (&*slot, value) {
            // 3 is a fine value for a number that is not whole.
            (Value::Float(_), Value::Integer(whole)) => Value::Float(whole as f64),
            (_, value) => value,
        };
        if slot.same_type(&value) {
            *slot = value;
        } else {
            let problem = format!("of type {}, where {} is needed", value.type_str(), slot.type_str());
            self.fault(source, problem);
        }
    }

    fn slot(&mut self, setting: &str) -> Option<&mut Value> {
        let (section, key) = setting.split_once('.')?;
        self.merged.get_mut(section)?.get_mut(key)
    }

    fn finish(mut self) -> Result<Settings, Vec<SettingFault>> {
        // Setting by setting, so that one that cannot be read does not hide the others' faults.
        let mut readable = Table::new();
        for (section, content) in std::mem::take(&mut self.merged) {
            let Value::Table(content) = content else { continue };
            let mut kept = Table::new();
            for (key, value) in content {
                let alone = Table::from_iter([(key.clone(), value.clone())]);
                match Table::from_iter([(section.clone(), Value::Table(alone))]).try_into::<Settings>() {
                    Ok(_) => {
                        kept.insert(key, value);
                    }
                    Err(error) => self.fault(&format!("{section}.{key}"), error.message().to_owned()),
                }
            }
            readable.insert(section, Value::Table(kept));
        }
        let settings: Settings = readable.try_into().unwrap_or_default();
        self.faults.extend(settings.faults());
        if self.faults.is_empty() { Ok(settings) } else { Err(self.faults) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variables(list: &[(&str, &str)]) -> Vec<(String, String)> {
        list.iter().map(|(name, value)| ((*name).into(), (*value).into())).collect()
    }

    #[test]
    fn later_layers_win() {
        let file = "[http]\nlisten = \"127.0.0.1:1\"\nmax_batch = 7\ndeadline_ms = 5\n";
        let settings = load(
            Some(file),
            variables(&[("SKYPOSE_HTTP_MAX_BATCH", "8"), ("SKYPOSE_HTTP_DEADLINE_MS", "6"), ("HOME", "/")]),
            &[("http.deadline_ms", "9".into())],
        )
        .expect("good settings");
        assert_eq!(settings.http.listen.port(), 1);
        assert_eq!((settings.http.max_batch, settings.http.deadline_ms), (8, 9));
        assert_eq!(settings.workers, Settings::default().workers);
    }

    #[test]
    fn every_fault_is_reported_at_once() {
        let file = "loose = 1\n[http]\nmax_batch = \"many\"\nlisten = \"nowhere\"\n[wrong]\nkey = 1\n[identify]\nmax_blobs = 3\n";
        let faults = load(
            Some(file),
            variables(&[("SKYPOSE_WORKERS_QUEUE", "-x"), ("SKYPOSE_HTPP_LISTEN", "x")]),
            &[("log.level", "=!".into())],
        )
        .expect_err("faults");
        let settings: Vec<&str> = faults.iter().map(|f| f.setting.as_str()).collect();
        for expected in [
            "loose",
            "http.max_batch",
            "wrong.key",
            "SKYPOSE_WORKERS_QUEUE",
            "SKYPOSE_HTPP_LISTEN",
            "http.listen",
            "identify.max_blobs",
            "log.level",
        ] {
            assert!(settings.contains(&expected), "{expected} is not among {faults:?}");
        }
    }

    #[test]
    fn an_address_is_checked_and_never_told() {
        let good = "postgres://sky:s3cret@db/poses";
        let settings = load(None, variables(&[("SKYPOSE_STORE_STORAGE", good)]), &[]).expect("good settings");
        assert_eq!(settings.store.storage.expose(), good);
        assert!(!format!("{settings:?}").contains("s3cret"));
        for bad in ["mysql://sky:s3cret@db/poses", "postgres://sky:s3cret@db"] {
            let faults = load(None, [], &[("store.storage", bad.into())]).expect_err("faults");
            assert_eq!(faults[0].setting, "store.storage");
            assert!(!format!("{faults:?}").contains("s3cret"), "{faults:?}");
        }
        let broken = "[http]\nmax_batch = 7\n[store]\nstorage = \"postgres://sky:s3cret@db/poses\n";
        let faults = load(Some(broken), [], &[]).expect_err("faults");
        assert!(faults[0].problem.starts_with("line 4: "), "{faults:?}");
        assert!(!format!("{faults:?}").contains("s3cret"), "{faults:?}");
    }

    #[test]
    fn a_whole_number_may_stand_for_one_that_need_not_be() {
        let settings = load(Some("[identify]\nmax_range_m = 300\n"), [], &[]).expect("good settings");
        assert!((settings.identify.max_range_m - 300.0).abs() < 1e-9);
    }

    #[test]
    fn the_defaults_make_sense() {
        assert_eq!(load(None, [], &[]), Ok(Settings::default()));
    }
}
