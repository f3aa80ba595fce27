//! The peer's processes.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, OnceLock};

/// A Python script that is spoken to line by line; it ends with its input.
pub struct Script {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Script {
    /// Starts a script of this folder.
    pub fn start(name: &str, arguments: &[&str]) -> Script {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let python: PathBuf = root.join("build/venv/bin/python");
        assert!(
            python.exists(),
            "{} is missing: `make venv` makes it, and `make test` does so first",
            python.display()
        );
        let mut child = Command::new(python)
            .arg(root.join("tests/peer").join(name))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python starts");
        let input = child.stdin.take();
        let output = BufReader::new(child.stdout.take().expect("its output"));
        Script {
            child,
            input,
            output,
        }
    }

    /// The next line that it says.
    pub fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("it says something");
        assert!(!line.is_empty(), "the peer has ended");
        line.trim_end().to_owned()
    }

    /// What it answers to a line.
    pub fn ask(&mut self, line: &str) -> String {
        let input = self.input.as_mut().expect("it listens");
        writeln!(input, "{line}").expect("it listens");
        self.line()
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        drop(self.input.take());
        let _ = self.child.wait();
    }
}

/// Asks the one process that reads and writes frames.
pub fn ask(line: &str) -> String {
    static PEER: OnceLock<Mutex<Script>> = OnceLock::new();
    let peer = PEER.get_or_init(|| Mutex::new(Script::start("pymodbus_peer.py", &[])));
    let mut peer = peer.lock().unwrap_or_else(|lock| lock.into_inner());
    peer.ask(line)
}
