//! Logs to standard error and metrics for Prometheus.

use std::io::IsTerminal;

use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use super::config::{LogFormat, LogSettings};

/// Upper ends of the time buckets: frames take from half a millisecond to a second.
const SECONDS: [f64; 13] = [0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.125, 0.25, 0.5, 1.0, 5.0];

/// Starts logging. A second call changes nothing.
pub fn start_logging(settings: &LogSettings) {
    let filter = EnvFilter::try_new(&settings.level).unwrap_or_else(|_| EnvFilter::new("info"));
    let registry = tracing_subscriber::registry().with(filter);
    let colored = std::io::stderr().is_terminal();
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(colored);
    let _ = match settings.format {
        LogFormat::Text => registry.with(lines).try_init(),
        LogFormat::Json => registry.with(lines.json()).try_init(),
    };
}

/// The process's metrics. There is one recorder a process; what is asked for first makes it.
pub fn metrics() -> PrometheusHandle {
    static HANDLE: std::sync::OnceLock<PrometheusHandle> = std::sync::OnceLock::new();
    HANDLE
        .get_or_init(|| {
            let builder = PrometheusBuilder::new()
                .set_buckets_for_metric(Matcher::Suffix("_seconds".into()), &SECONDS)
                .unwrap_or_else(|_| PrometheusBuilder::new());
            let recorder = builder.build_recorder();
            let handle = recorder.handle();
            if metrics::set_global_recorder(recorder).is_err() {
                tracing::warn!("another metrics recorder is installed: /metrics stays empty");
            }
            describe();
            handle
        })
        .clone()
}

fn describe() {
    use metrics::{Unit, describe_counter, describe_gauge, describe_histogram};
    describe_counter!("skypose_requests_total", "Requests answered, by route, method and status.");
    describe_histogram!("skypose_request_seconds", Unit::Seconds, "Time from the head of a request to its reply.");
    describe_gauge!("skypose_in_flight", "Requests being read or answered.");
    describe_gauge!("skypose_queue_waiting", "Requests waiting for a worker.");
    describe_counter!("skypose_shed_total", "Requests refused because the service was full.");
    describe_histogram!("skypose_stage_seconds", Unit::Seconds, "Time of each stage of a frame.");
    describe_counter!("skypose_frames_total", "Frames looked at, by what came of them.");
    describe_gauge!("skypose_jobs", "Stored jobs, by kind and state.");
    describe_counter!("skypose_jobs_ended_total", "Jobs that this process has ended, by kind and state.");
    describe_histogram!("skypose_shard_seconds", Unit::Seconds, "Time of one shard of a job, by kind.");
    describe_counter!("skypose_worker_panics_total", "Requests whose computation failed by a fault of ours.");
}
