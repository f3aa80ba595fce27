//! The processes of the peer: Python scripts, and mbm's server in C.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, OnceLock};

/// A program that reads and writes lines. It ends when its input is closed.
pub struct Script {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Script {
    /// Starts a Python script of this folder.
    pub fn start(name: &str, arguments: &[&str]) -> Script {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer");
        let python = built("build/venv/bin/python", "venv");
        // -B: Python writes no compiled files into the folder of the tests.
        Script::spawn(
            Command::new(python)
                .arg("-B")
                .arg(script.join(name))
                .args(arguments),
        )
    }

    /// Starts mbm's server in C, `c-tests/serve.c`.
    pub fn serve(framing: &str) -> Script {
        let program = built("build/plain/serve", "build/plain/serve");
        Script::spawn(Command::new(program).arg(framing))
    }

    fn spawn(command: &mut Command) -> Script {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let input = child.stdin.take();
        let output = BufReader::new(child.stdout.take().expect("the program's output"));
        Script {
            child,
            input,
            output,
        }
    }

    /// The next line of the program's output.
    pub fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("a line of output");
        assert!(!line.is_empty(), "the program has ended");
        line.trim_end().to_owned()
    }

    /// Writes a line to the program; returns the line with which it answers.
    pub fn query(&mut self, line: &str) -> String {
        let input = self.input.as_mut().expect("the program's input is open");
        writeln!(input, "{line}").expect("the program reads its input");
        self.line()
    }
}

/// The path of a file that make must have built before.
fn built(path: &str, target: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    assert!(
        path.exists(),
        "{} is missing: run `make {target}`, or `make test`, which builds it first",
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

/// Sends a line to the one process that reads and writes frames; returns its answer.
pub fn query(line: &str) -> String {
    static PEER: OnceLock<Mutex<Script>> = OnceLock::new();
    let peer = PEER.get_or_init(|| Mutex::new(Script::start("pymodbus_peer.py", &[])));
    let mut peer = peer.lock().unwrap_or_else(|lock| lock.into_inner());
    peer.query(line)
}
