//! The peer's processes.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, OnceLock};

/// A program that is spoken to line by line; it ends with its input.
pub struct Script {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Script {
    /// Starts a Python script of this folder.
    pub fn start(name: &str, arguments: &[&str]) -> Script {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer");
        let python = made("build/venv/bin/python", "venv");
        Script::spawn(Command::new(python).arg(script.join(name)).args(arguments))
    }

    /// Starts our server in C, `c-tests/serve.c`.
    pub fn serve(framing: &str) -> Script {
        let program = made("build/plain/serve", "build/plain/serve");
        Script::spawn(Command::new(program).arg(framing))
    }

    fn spawn(command: &mut Command) -> Script {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("it starts");
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

/// What make is to have made before.
fn made(path: &str, target: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    assert!(
        path.exists(),
        "{} is missing: `make {target}` makes it, and `make test` does so first",
        path.display()
    );
    path
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
