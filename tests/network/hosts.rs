//! Two hosts on this machine: network namespaces with a link that delays and loses.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Where the client is reached, and the server.
const CLIENT: &str = "10.213.7.1";
pub const SERVER: &str = "10.213.7.2";
/// What our namespaces begin with; the process that has made them and a number follow.
const OURS: &str = "skypose-";

/// Two namespaces, taken down when dropped.
pub struct Hosts {
    client: String,
    server: String,
    link: Link,
    delay: Duration,
}

/// What is between them.
enum Link {
    /// A pair of devices, each with its queue that delays and loses.
    Queues,
    /// Two devices with a program between them, where the kernel has no such queue.
    Wire(Wire),
}

impl Hosts {
    /// Two hosts whose link delays every packet by this time and loses this share of them, each way. Nothing where the machine does not
    /// let us make them; the reason is printed.
    pub fn linked(delay: Duration, loss_percent: u32) -> Option<Self> {
        match Self::make(delay, loss_percent) {
            Ok(hosts) => Some(hosts),
            Err(reason) => {
                println!("left out: {reason}");
                None
            }
        }
    }

    fn make(delay: Duration, loss_percent: u32) -> Result<Self, String> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::SeqCst);
        sweep()?;
        let process = std::process::id();
        let name = |end: &str| format!("{OURS}{process}-{number}{end}");
        let devices = ["c", "s"].map(|end| format!("sp{process}n{number}{end}"));
        let mut hosts = Self { client: name("c"), server: name("s"), link: Link::Queues, delay };
        for host in [&hosts.client, &hosts.server] {
            run("ip", &["netns", "add", host])?;
        }
        let queues = run("ip", &["link", "add", &devices[0], "type", "veth", "peer", "name", &devices[1]])
            .and_then(|()| hosts.join(&devices))
            .and_then(|()| hosts.queue("add", loss_percent));
        if let Err(reason) = queues {
            println!("{reason}; a program takes the packets across instead (tests/clients/wire.py)");
            for host in [&hosts.client, &hosts.server] {
                // Down with one of a pair, down with both.
                let _ = run("ip", &["-n", host, "link", "del", "link0"]);
            }
            let _ = run("ip", &["link", "del", &devices[0]]);
            hosts.link = Link::Wire(Wire::between(&devices, delay, loss_percent)?);
            hosts.join(&devices)?;
        }
        Ok(hosts)
    }

    /// Gives each host its device.
    fn join(&self, devices: &[String; 2]) -> Result<(), String> {
        let hosts = [(&self.client, CLIENT, SERVER), (&self.server, SERVER, CLIENT)];
        for ((host, own, other), device) in hosts.into_iter().zip(devices) {
            run("ip", &["link", "set", device, "netns", host, "name", "link0"])?;
            run("ip", &["-n", host, "address", "add", own, "peer", other, "dev", "link0"])?;
            run("ip", &["-n", host, "link", "set", "link0", "up"])?;
            run("ip", &["-n", host, "link", "set", "lo", "up"])?;
        }
        Ok(())
    }

    fn queue(&self, verb: &str, loss_percent: u32) -> Result<(), String> {
        let (delay, loss) = (format!("{}ms", self.delay.as_millis()), format!("{loss_percent}%"));
        for host in [&self.client, &self.server] {
            let own = ["qdisc", verb, "dev", "link0", "root", "netem", "delay", &delay, "loss", &loss];
            run("tc", &[&["-n", host], &own[..]].concat())?;
        }
        Ok(())
    }

    /// From now on this share of the packets is lost; all of them is a link that is cut.
    pub fn lose(&mut self, percent: u32) {
        match &mut self.link {
            Link::Queues => self.queue("change", percent).expect("as before"),
            Link::Wire(wire) => wire.lose(percent),
        }
    }

    pub fn on_client(&self, program: &str) -> Command {
        on(&self.client, program)
    }

    pub fn on_server(&self, program: &str) -> Command {
        on(&self.server, program)
    }
}

impl Drop for Hosts {
    fn drop(&mut self) {
        for host in [&self.client, &self.server] {
            let _ = run("ip", &["netns", "del", host]);
        }
    }
}

/// A command on a host, which has no memory in common with the other. It takes the place of `ip`, so that the process is the program's.
fn on(host: &str, program: &str) -> Command {
    let mut command = Command::new("ip");
    command.args(["netns", "exec", host, "sh", "-c", "mount -t tmpfs none /dev/shm && exec \"$0\" \"$@\"", program]);
    command
}

/// Takes down what processes have left that were killed.
fn sweep() -> Result<(), String> {
    let list = Command::new("ip").args(["netns", "list"]).output().map_err(|error| format!("ip: {error}"))?;
    for name in String::from_utf8_lossy(&list.stdout).lines().filter_map(|line| line.split_whitespace().next()) {
        let process = name.strip_prefix(OURS).and_then(|rest| rest.split('-').next());
        if process.is_some_and(|process| !Path::new("/proc").join(process).exists()) {
            let _ = run("ip", &["netns", "del", name]);
        }
    }
    Ok(())
}

fn run(program: &str, arguments: &[&str]) -> Result<(), String> {
    let command = || format!("{program} {}", arguments.join(" "));
    let done = Command::new(program).args(arguments).output().map_err(|error| format!("{}: {error}", command()))?;
    if done.status.success() {
        return Ok(());
    }
    Err(format!("{}: {}", command(), String::from_utf8_lossy(&done.stderr).trim()))
}

/// The program between two devices.
struct Wire {
    program: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Wire {
    fn between(devices: &[String; 2], delay: Duration, loss_percent: u32) -> Result<Self, String> {
        if fs::metadata("/dev/net/tun").is_err() {
            return Err("there is no /dev/net/tun".into());
        }
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients/wire.py");
        let mut command = Command::new("python3");
        command.arg(script).args(devices);
        command.args([delay.as_millis().to_string(), loss_percent.to_string(), "20261129".into()]);
        let mut program = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("python3: {error}"))?;
        let input = program.stdin.take().expect("piped");
        let output = BufReader::new(program.stdout.take().expect("piped"));
        let mut wire = Self { program, input, output };
        if wire.said() == "ready" { Ok(wire) } else { Err("no TUN device can be made".into()) }
    }

    fn said(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("a line");
        line.trim().to_owned()
    }

    fn lose(&mut self, percent: u32) {
        writeln!(self.input, "{percent}").expect("writes");
        assert_eq!(self.said(), "so");
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}
