//! What is handed to those who run the service says what the program does.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

use std::fs;
use std::path::Path;

use skypose::shell::config::{Settings, load};

fn file(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn the_settings_file_lists_every_setting_with_its_default() {
    let text = file("deploy/skypose.toml");
    assert_eq!(load(Some(&text), [], &[]), Ok(Settings::default()));
    let listed: toml::Table = text.parse().expect("TOML");
    let known = toml::Table::try_from(Settings::default()).expect("settings");
    for (section, settings) in known {
        for (setting, value) in settings.as_table().expect("a section") {
            assert_eq!(listed[&section].get(setting), Some(value), "{section}.{setting}");
        }
    }
}

#[test]
fn every_setting_has_a_reason() {
    let text = file("deploy/skypose.toml");
    let mut explained = false;
    for line in text.lines() {
        match line.trim() {
            "" => explained = false,
            line if line.starts_with('#') => explained = true,
            line if line.starts_with('[') => {}
            line => assert!(explained, "{line:?} stands there without a word"),
        }
    }
}

#[test]
fn the_container_runs_what_is_built_and_not_as_root() {
    let text = file("Dockerfile");
    for needed in ["USER skypose", "HEALTHCHECK", "skypose", "/readyz", "EXPOSE 8080"] {
        assert!(text.contains(needed), "the Dockerfile has no {needed:?}");
    }
}

#[test]
fn the_unit_and_the_compose_file_use_settings_that_exist() {
    for name in ["deploy/skypose.service", "deploy/compose.yaml", "Dockerfile"] {
        for word in file(name).split(|c: char| !(c.is_ascii_uppercase() || c == '_')) {
            if word.starts_with("SKYPOSE_") && word != "SKYPOSE_CONFIG" {
                let variable = [(word.to_owned(), "0.0.0.0:8080".to_owned())];
                let known = match load(None, variable, &[]) {
                    Ok(_) => true,
                    Err(faults) => faults.iter().all(|fault| fault.problem != "no such setting"),
                };
                assert!(known, "{name} sets {word}, which there is not");
            }
        }
    }
}
