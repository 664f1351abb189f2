//! Requests from a text: one JSON value a line, or spread over lines as people print them.

use std::collections::VecDeque;
use std::io::{self, BufRead};

use serde_json::Value;

use crate::shell::fault::Fault;
use crate::shell::wire::from_json;

/// Each JSON value with the number of its first line. A value that a line leaves open goes on in the next ones; where that
/// leads to no JSON, the first line is at fault and the next are read anew, so that a line cut short costs no other.
pub(super) struct Requests<R> {
    text: R,
    /// Lines read ahead.
    ahead: VecDeque<Vec<u8>>,
    /// Lines given out.
    passed: usize,
}

impl<R: BufRead> Requests<R> {
    pub(super) const fn of(text: R) -> Self {
        Self { text, ahead: VecDeque::new(), passed: 0 }
    }

    /// The line `index` places ahead; `None` at the end.
    fn line(&mut self, index: usize) -> io::Result<Option<&[u8]>> {
        while self.ahead.len() <= index {
            let mut line = Vec::new();
            if self.text.read_until(b'\n', &mut line)? == 0 {
                return Ok(None);
            }
            self.ahead.push_back(line);
        }
        Ok(self.ahead.get(index).map(Vec::as_slice))
    }

    fn pass(&mut self, lines: usize) {
        self.ahead.drain(..lines);
        self.passed += lines;
    }

    fn read(&mut self) -> io::Result<Option<(usize, Result<Value, Fault>)>> {
        while self.line(0)?.is_some_and(|line| line.iter().all(u8::is_ascii_whitespace)) {
            self.pass(1);
        }
        let number = self.passed + 1;
        let mut text = Vec::new();
        let mut lines = 0_usize;
        let mut nesting = Nesting::default();
        while let Some(line) = self.line(lines)? {
            text.extend_from_slice(line);
            lines += 1;
            // Parsed when it may be whole, and now and then to see whether it still can be, so that the work stays in
            // proportion.
            if !nesting.after(line).is_closed() && !lines.is_power_of_two() {
                continue;
            }
            match serde_json::from_slice::<Value>(&text) {
                Ok(value) => {
                    self.pass(lines);
                    return Ok(Some((number, Ok(value))));
                }
                Err(error) if error.is_eof() => {}
                Err(_) => break,
            }
        }
        if lines == 0 {
            return Ok(None);
        }
        let fault = from_json::<Value>(&self.ahead[0]).err();
        self.pass(1);
        Ok(fault.map(|fault| (number, Err(fault))))
    }
}

/// How deep in brackets a text is.
#[derive(Clone, Copy, Default)]
struct Nesting {
    depth: i64,
    in_string: bool,
    escaped: bool,
}

impl Nesting {
    fn after(&mut self, text: &[u8]) -> Self {
        for byte in text {
            match byte {
                _ if self.escaped => self.escaped = false,
                b'\\' if self.in_string => self.escaped = true,
                b'"' => self.in_string = !self.in_string,
                b'{' | b'[' if !self.in_string => self.depth += 1,
                b'}' | b']' if !self.in_string => self.depth -= 1,
                _ => {}
            }
        }
        *self
    }

    const fn is_closed(self) -> bool {
        self.depth <= 0 && !self.in_string
    }
}

impl<R: BufRead> Iterator for Requests<R> {
    type Item = io::Result<(usize, Result<Value, Fault>)>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read().transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Vec<(usize, Option<String>)> {
        let values = Requests::of(text.as_bytes()).map(|read| read.expect("memory"));
        values.map(|(number, value)| (number, value.ok().map(|value| value.to_string()))).collect()
    }

    fn good(number: usize, text: &str) -> (usize, Option<String>) {
        (number, Some(text.into()))
    }

    #[test]
    fn a_line_is_a_value() {
        assert_eq!(read("{\"a\":1}\n\n  \n[2]"), [good(1, "{\"a\":1}"), good(4, "[2]")]);
        assert_eq!(read(""), []);
        assert_eq!(read("\n\n"), []);
    }

    #[test]
    fn a_value_may_be_spread_over_lines() {
        assert_eq!(read("{\n \"a\":\n  [1,\n   2]\n}\n{}"), [good(1, "{\"a\":[1,2]}"), good(6, "{}")]);
    }

    #[test]
    fn brackets_in_strings_are_no_brackets() {
        let text = "{\"a\": \"]}\\\"\",\n\n\n\n\n \"b\": 1}\n[]";
        assert_eq!(read(text), [good(1, "{\"a\":\"]}\\\"\",\"b\":1}"), good(7, "[]")]);
    }

    #[test]
    fn a_bad_line_costs_no_other() {
        assert_eq!(read("{}\nnonsense\n{}"), [good(1, "{}"), (2, None), good(3, "{}")]);
        assert_eq!(read("{\"a\": \n{}\n{}"), [(1, None), good(2, "{}"), good(3, "{}")]);
        assert_eq!(read("{}\n{\"a\":"), [good(1, "{}"), (2, None)]);
    }
}
