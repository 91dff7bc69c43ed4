//! The real program on a port of its own, and a client of it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::sse::Stream;

const BIN: &str = env!("CARGO_BIN_EXE_grainrig");
/// Longer than anything here takes on a busy computer: a test that hangs is to fail, not to wait for ever.
const PATIENCE: Duration = Duration::from_secs(300);

/// A small picture in which the grain fills a quarter of the height, few views, a coarse mesh: a run takes
/// about a second.
pub const SMALL: &str = "
[simulated]
width = 648
height = 432
mm_per_px = 0.006
[optics]
mm_per_px = 0.006
[plan]
views = 5
steps_per_view = 40
settle_ms = 0
[mesh]
surface_size_mm = 0.12
";

/// A data folder and the configuration for it; they go with it.
pub struct Lab {
    dir: TempDir,
}

impl Lab {
    pub fn new(config: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("rig.toml"), config).unwrap();
        Self { dir }
    }

    pub fn data(&self) -> PathBuf {
        self.dir.path().join("data")
    }

    /// The program with this command, data folder and configuration.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(BIN);
        command.args(arguments).arg("--data").arg(self.data());
        command.arg("--config").arg(self.dir.path().join("rig.toml"));
        command.env_remove("GRAINRIG_LOG").env_remove("GRAINRIG_LOG_FORMAT").stdin(Stdio::null());
        command
    }

    /// Runs a command to its end: exit code, standard output and error.
    pub fn run(&self, arguments: &[&str]) -> (Option<i32>, String, String) {
        let output = self.command(arguments).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    }

    /// Starts the daemon and waits until it says where it listens.
    pub fn serve(&self) -> Daemon {
        let mut command = self.command(&["serve", "--listen", "127.0.0.1:0"]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("http://") {
            line.clear();
            assert!(said.read_line(&mut line).unwrap() > 0, "the daemon ended: {:?}", child.wait());
        }
        let (_, after) = line.split_once("http://").unwrap();
        let address = after.split('/').next().unwrap().parse().unwrap();
        // Read as it comes: a daemon whose log is not read waits for its reader.
        let said = std::thread::spawn(move || {
            let mut all = String::new();
            let _ = said.read_to_string(&mut all);
            all
        });
        Daemon { child, said: Some(said), address, token: None }
    }
}

/// A running daemon; it is killed when dropped.
pub struct Daemon {
    child: Child,
    said: Option<JoinHandle<String>>,
    pub address: SocketAddr,
    pub token: Option<&'static str>,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Daemon {
    pub fn url(&self, path: &str) -> String {
        format!("http://{}/api/v1{path}", self.address)
    }

    pub fn get_bytes(&self, path: &str) -> (u16, Vec<u8>) {
        let request = client().get(self.url(path));
        let request = match self.token {
            Some(token) => request.header("authorization", format!("Bearer {token}")),
            None => request,
        };
        let mut response = request.call().unwrap();
        let bytes = response.body_mut().with_config().limit(1 << 30).read_to_vec().unwrap();
        (response.status().as_u16(), bytes)
    }

    pub fn get(&self, path: &str) -> (u16, Value) {
        let (status, bytes) = self.get_bytes(path);
        (status, serde_json::from_slice(&bytes).unwrap())
    }

    pub fn post(&self, path: &str, body: Option<&Value>) -> (u16, Value) {
        let request = client().post(self.url(path));
        let request = match self.token {
            Some(token) => request.header("authorization", format!("Bearer {token}")),
            None => request,
        };
        let mut response = match body {
            Some(body) => request.send_json(body),
            None => request.send_empty(),
        }
        .unwrap();
        let bytes = response.body_mut().read_to_vec().unwrap();
        let body = if bytes.is_empty() { Value::Null } else { serde_json::from_slice(&bytes).unwrap() };
        (response.status().as_u16(), body)
    }

    /// Puts a file beside the sessions.
    pub fn put(&self, name: &str, bytes: &[u8]) -> u16 {
        let request = client().put(self.url(&format!("/files/{name}")));
        request.send(bytes).unwrap().status().as_u16()
    }

    pub fn delete(&self, path: &str) -> u16 {
        client().delete(self.url(path)).call().unwrap().status().as_u16()
    }

    /// Asks for a run with these settings otherwise than the configuration's.
    pub fn start(&self, name: &str, overrides: Value) -> (u16, Value) {
        let mut body = overrides;
        body["name"] = json!(name);
        self.post("/runs", Some(&body))
    }

    /// The event stream after the event `last`; from now on without.
    pub fn events(&self, last: Option<u64>) -> Stream {
        Stream::open(client().get(self.url("/events")), last)
    }

    /// Sends these bytes and returns all that comes back.
    pub fn raw(&self, bytes: &[u8]) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        // The daemon may hang up before all of it is sent.
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// Its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn signal(&self, name: &str) {
        let status = Command::new("kill").args(["-s", name, &self.child.id().to_string()]).status();
        assert!(status.unwrap().success());
    }

    /// Waits for the daemon's end: how it ended, and what it said.
    pub fn ended(&mut self) -> (ExitStatus, String) {
        let status = self.child.wait().unwrap();
        (status, self.said.take().map(|said| said.join().unwrap()).unwrap_or_default())
    }
}

/// A client that returns errors' bodies.
fn client() -> ureq::Agent {
    ureq::Agent::config_builder()
        .http_status_as_error(false)
        .max_redirects(0)
        .timeout_global(Some(PATIENCE))
        .build()
        .new_agent()
}

/// Every file below a folder with its bytes, in order.
pub fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let bytes = std::fs::read(&path).unwrap();
                found.push((path, bytes));
            }
        }
    }
    found.sort();
    found
}
