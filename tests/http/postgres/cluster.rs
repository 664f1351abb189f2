//! A PostgreSQL of one's own: in a temporary folder, on a socket in it, gone with the test, however that ends. Shared by the tests of the
//! doors and those of the rooms.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{ConnectOptions, Connection};

/// If this is `required`, tests fail where there is no PostgreSQL; otherwise they say so and are left out.
const DEMAND: &str = "POSTGRES_TESTS";

/// Stops the server and removes its folder when its input ends, that is, when the test's process does; told `stop`, it keeps the folder.
const KEEPER: &str = r#"folder=$1; shift
"$@" & server=$!
read -r word
kill -INT $server; wait $server
[ "$word" = stop ] || rm -rf "$folder""#;

/// The owner of the cluster, who needs no password.
const OWNER: &str = "skypose";

pub struct Cluster {
    folder: PathBuf,
    programs: PathBuf,
    keeper: Option<Child>,
    databases: AtomicU32,
}

impl Cluster {
    /// `None` if PostgreSQL is not installed.
    pub async fn start() -> Option<Self> {
        let Some(programs) = programs() else {
            let demanded = std::env::var(DEMAND).is_ok_and(|demand| demand == "required");
            assert!(!demanded, "PostgreSQL is not installed (Debian: postgresql), and {DEMAND}=required");
            println!("left out: PostgreSQL is not installed (Debian: postgresql)");
            return None;
        };
        let folder = tempfile::Builder::new().prefix("skypose-pg-").tempdir().expect("a folder").keep();
        if let Some(nobody) = nobody() {
            std::os::unix::fs::chown(&folder, Some(nobody), Some(nobody)).expect("given away");
        }
        let data = folder.join("data");
        let made = as_nobody(&programs.join("initdb"))
            .args(["-A", "trust", "-U", OWNER, "-E", "UTF8", "--locale=C", "--no-sync", "-D"])
            .arg(&data)
            .current_dir("/")
            .stdin(Stdio::null())
            .output()
            .expect("initdb runs");
        assert!(made.status.success(), "initdb: {}", String::from_utf8_lossy(&made.stderr));
        let mut cluster = Self { folder, programs, keeper: None, databases: AtomicU32::new(0) };
        cluster.run().await;
        Some(cluster)
    }

    /// Starts the server, if it does not run.
    pub async fn run(&mut self) {
        let mut server = as_nobody(&self.programs.join("postgres"));
        server.arg("-D").arg(self.folder.join("data")).arg("-k").arg(&self.folder);
        for setting in ["listen_addresses=", "fsync=off", "max_connections=300", "shared_buffers=32MB"] {
            server.args(["-c", setting]);
        }
        let mut keeper = Command::new("sh");
        keeper.args(["-c", KEEPER, "sh"]).arg(&self.folder).arg(server.get_program()).args(server.get_args());
        let log = std::fs::File::options().create(true).append(true).open(self.folder.join("log")).expect("a log");
        let keeper = keeper
            .current_dir("/")
            .stdin(Stdio::piped())
            .stdout(log.try_clone().expect("a log"))
            .stderr(log)
            .spawn()
            .expect("sh runs");
        self.keeper = Some(keeper);
        for _ in 0..600 {
            if let Ok(connection) = self.connect().await {
                let _ = connection.close().await;
                return;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        panic!("PostgreSQL does not start: {}", std::fs::read_to_string(self.folder.join("log")).unwrap_or_default());
    }

    /// Stops the server: its connections end.
    #[allow(dead_code, reason = "not all who share this need it")]
    pub fn stop(&mut self) {
        use std::io::Write;
        if let Some(mut keeper) = self.keeper.take() {
            keeper.stdin.take().expect("piped").write_all(b"stop\n").expect("it listens");
            keeper.wait().expect("it ends");
        }
    }

    /// Address of a new database.
    pub async fn database(&self) -> String {
        let name = format!("test_{}", self.databases.fetch_add(1, Ordering::Relaxed));
        let mut connection = self.connect().await.expect("connects");
        let query = format!("CREATE DATABASE {name} TEMPLATE template0");
        sqlx::query(sqlx::AssertSqlSafe(query)).execute(&mut connection).await.expect("creates");
        connection.close().await.expect("closes");
        format!("postgres://{OWNER}@localhost/{name}?host={}", self.folder.display())
    }

    async fn connect(&self) -> Result<PgConnection, sqlx::Error> {
        PgConnectOptions::new_without_pgpass()
            .socket(&self.folder)
            .username(OWNER)
            .database("postgres")
            .disable_statement_logging()
            .connect()
            .await
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        match self.keeper.take() {
            Some(mut keeper) => {
                drop(keeper.stdin.take());
                let _ = keeper.wait();
            }
            None => drop(std::fs::remove_dir_all(&self.folder)),
        }
    }
}

/// The folder of `initdb` and `postgres`: on the path, or where Debian has it.
fn programs() -> Option<PathBuf> {
    let on_path = std::env::var_os("PATH").map(|path| std::env::split_paths(&path).collect::<Vec<_>>());
    let mut debian: Vec<PathBuf> = std::fs::read_dir("/usr/lib/postgresql")
        .map(|versions| versions.flatten().map(|version| version.path().join("bin")).collect())
        .unwrap_or_default();
    debian.sort();
    let mut places = on_path.into_iter().flatten().chain(debian.into_iter().rev());
    places.find(|place| place.join("initdb").is_file() && place.join("postgres").is_file())
}

/// PostgreSQL refuses to run as root: then as nobody.
fn nobody() -> Option<u32> {
    rustix::process::getuid().is_root().then_some(65_534)
}

fn as_nobody(program: &Path) -> Command {
    let Some(nobody) = nobody() else { return Command::new(program) };
    let mut command = Command::new("setpriv");
    command.args([format!("--reuid={nobody}"), format!("--regid={nobody}")]);
    command.args(["--clear-groups", "--"]).arg(program);
    command
}
