//! How methods of this process are timed.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

use crate::method::{Method, Results, median};
use crate::study::{Study, Task};

/// Times of one method, task by task, round by round.
#[derive(Default)]
pub struct Times(BTreeMap<(String, &'static str), Vec<Vec<f64>>>);

impl Times {
    /// Solves every task of the study once with every method that takes it. A clock stands before and behind each solution, and
    /// nothing is subtracted.
    pub fn round(&mut self, study: &Study, methods: &[&Method]) {
        for method in methods.iter().filter(|method| (method.takes)(study)) {
            let of_tasks =
                self.0.entry((study.name.clone(), method.name)).or_insert_with(|| vec![Vec::new(); study.tasks.len()]);
            for (task, times) in study.tasks.iter().zip(of_tasks) {
                times.push(time_us(method, task));
            }
        }
    }

    /// What the method gave, `None` if it took no part.
    pub fn results(&self, study: &Study, method: &Method) -> Option<Results> {
        let of_tasks = self.0.get(&(study.name.clone(), method.name))?;
        Some(Results {
            answers: study.tasks.iter().map(method.solve).collect(),
            time_us: median(of_tasks.iter().map(|times| median(times.clone())).collect()),
        })
    }
}

fn time_us(method: &Method, task: &Task) -> f64 {
    let start = Instant::now();
    black_box((method.solve)(black_box(task)));
    start.elapsed().as_secs_f64() * 1e6
}
