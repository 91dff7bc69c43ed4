//! The guest: a computer that QEMU emulates, with Debian's kernel, udev, and this program (`prepare.sh`, `init`, `agent`).

use crate::kit::{Lab, Ran};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

/// From the power switch to the first command; 11 s where nothing else runs.
const BOOT: Duration = Duration::from_secs(120);
/// The longest command; a capture with all that is computed from it takes 60 s where nothing else runs.
const ANSWER: Duration = Duration::from_secs(300);
/// As many as `init` sends: one does what the test is about, one watches it.
const AGENTS: usize = 2;
/// What QEMU calls the serial adapter.
const ADAPTER: &str = "adapter";
const LINE: &str = "line";
/// Its serial number, by which udev names it.
const SERIAL: &str = "A5069RR4";

/// A running guest.
pub struct Guest {
    qemu: Child,
    agents: Vec<Agent>,
}

/// Somebody in the guest who does what he is told.
pub struct Agent {
    line: BufReader<TcpStream>,
    console: PathBuf,
}

impl Guest {
    /// Boots the guest that was prepared in a folder, with a serial line behind a USB adapter and the camera that is served
    /// at a port of this computer. `monitor` is where QEMU itself is spoken to.
    pub fn boot(folder: &Path, lab: &Lab, line: &Path, camera: u16, monitor: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let agent = listener.local_addr().unwrap().port();
        let console = lab.path("console");
        let said = File::create(lab.path("qemu")).unwrap();
        let qemu = Command::new("qemu-system-x86_64")
            // The emulator: where the processor's own help can be had differs from place to place. A processor without the
            // wide instructions, as emulating those takes twice the time of doing without.
            .args([
                "-accel",
                "tcg",
                "-cpu",
                "qemu64",
                "-smp",
                "2",
                "-m",
                "768",
                "-display",
                "none",
                "-no-reboot",
            ])
            .arg("-kernel")
            .arg(folder.join("kernel"))
            .arg("-initrd")
            .arg(folder.join("initramfs"))
            .args(["-append", &format!("console=ttyS0 panic=-1 loglevel=4 agent={agent} camera={camera}")])
            .args(["-serial", &format!("file:{}", console.display())])
            .args(["-qmp", &format!("unix:{},server=on,wait=off", monitor.display())])
            .args(["-nic", "user,model=e1000", "-device", "qemu-xhci"])
            .args(["-chardev", &format!("serial,id={LINE},path={}", line.display())])
            .args(["-device", &format!("usb-serial,chardev={LINE},id={ADAPTER},serial={SERIAL}")])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(said)
            .spawn()
            .unwrap();
        let (came, comes) = channel();
        std::thread::spawn(move || {
            for agent in listener.incoming().take(AGENTS).map_while(Result::ok) {
                if came.send(agent).is_err() {
                    return;
                }
            }
        });
        let mut guest = Self { qemu, agents: Vec::new() };
        while guest.agents.len() < AGENTS {
            let Ok(agent) = comes.recv_timeout(BOOT) else {
                let said =
                    [&lab.path("qemu"), &console].map(|f| std::fs::read_to_string(f).unwrap_or_default());
                panic!("the guest does not answer within {BOOT:?}: {}", said.concat())
            };
            agent.set_read_timeout(Some(ANSWER)).unwrap();
            guest.agents.push(Agent { line: BufReader::new(agent), console: console.clone() });
        }
        guest
    }

    /// Somebody in the guest; each can be had once.
    pub fn agent(&mut self) -> Agent {
        self.agents.pop().expect("no agent is left")
    }
}

impl Agent {
    /// Runs a line of shell in the guest.
    pub fn run(&mut self, line: &str) -> Ran {
        let (code, stdout, stderr) = self.ask(line);
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Ran::of(Some(code), text(stdout), text(stderr))
    }

    fn ask(&mut self, line: &str) -> (i32, Vec<u8>, Vec<u8>) {
        let failed = |console: &Path, e: &dyn std::fmt::Display| -> ! {
            let said = std::fs::read_to_string(console).unwrap_or_default();
            panic!("{line}: {e}; the guest's console: {said}")
        };
        writeln!(self.line.get_mut(), "{line}").unwrap();
        let mut head = String::new();
        if let Err(e) = self.line.read_line(&mut head) {
            failed(&self.console, &e);
        }
        let numbers: Vec<usize> = head.split_whitespace().filter_map(|n| n.parse().ok()).collect();
        let [code, out, err] = numbers[..] else { failed(&self.console, &format!("answered by {head:?}")) };
        let mut take = |count| {
            let mut bytes = vec![0; count];
            self.line.read_exact(&mut bytes).unwrap();
            bytes
        };
        (code as i32, take(out), take(err))
    }

    /// Writes a file.
    pub fn write(&mut self, path: &str, text: &str) {
        self.run(&format!("echo {} | base64 -d > {path}", STANDARD.encode(text))).succeeds();
    }

    /// Waits until something is so in the guest, which a line of shell looks at.
    pub fn wait_until(&mut self, condition: &str) {
        let line = format!("for i in $(seq 600); do {condition} && exit 0; sleep 0.1; done; exit 1");
        let ran = self.run(&line);
        assert_eq!(ran.code, Some(0), "it never was so: {condition}");
    }

    /// Brings a session of the guest's into the folder of those of this computer.
    pub fn fetch(&mut self, lab: &Lab, name: &str) {
        let (code, archive, _) = self.ask(&format!("tar -c -C /data {name}"));
        assert_eq!(code, 0);
        let data = lab.path("data");
        std::fs::create_dir_all(&data).unwrap();
        let mut tar =
            Command::new("tar").arg("-x").arg("-C").arg(data).stdin(Stdio::piped()).spawn().unwrap();
        tar.stdin.take().unwrap().write_all(&archive).unwrap();
        assert!(tar.wait().unwrap().success());
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        // What is in it is in memory only.
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// QEMU itself, which has its hands on the cables.
pub struct Monitor {
    line: BufReader<UnixStream>,
}

impl Monitor {
    pub fn connect(path: &Path) -> Self {
        let line = UnixStream::connect(path).unwrap();
        line.set_read_timeout(Some(ANSWER)).unwrap();
        let mut monitor = Self { line: BufReader::new(line) };
        monitor.wait_for("QMP");
        monitor.tell(&json!({"execute": "qmp_capabilities"}));
        monitor.wait_for("return");
        monitor
    }

    fn tell(&mut self, what: &Value) {
        writeln!(self.line.get_mut(), "{what}").unwrap();
    }

    /// Waits for an object that has this key; others are about what happened by itself.
    fn wait_for(&mut self, key: &str) -> Value {
        loop {
            let mut text = String::new();
            assert!(self.line.read_line(&mut text).unwrap() > 0, "QEMU ended");
            let said: Value = serde_json::from_str(&text).unwrap();
            assert!(said.get("error").is_none(), "{said}");
            if said.get(key).is_some() {
                return said;
            }
        }
    }

    /// Pulls the serial adapter out.
    pub fn unplug(&mut self) {
        self.tell(&json!({"execute": "device_del", "arguments": {"id": ADAPTER}}));
        while self.wait_for("event")["event"] != "DEVICE_DELETED" {}
    }

    /// Plugs it in again.
    pub fn plug(&mut self) {
        let adapter = json!({"driver": "usb-serial", "chardev": LINE, "id": ADAPTER, "serial": SERIAL});
        self.tell(&json!({"execute": "device_add", "arguments": adapter}));
        self.wait_for("return");
    }
}
