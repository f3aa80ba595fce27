//! tokio-modbus reads the registers that the clients of `c-tests/bench_client.c` read, in a runtime of one thread.
//!
//! `tokio_client PORT COUNT` makes that many transactions, for callgrind. `tokio_client PORT rounds` makes as many
//! as each line of its input says, and prints the seconds, and p50 and p99 of a transaction in microseconds.

use std::io::{BufRead, Write};
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Instant;
use tokio::net::TcpStream;
use tokio_modbus::client::{tcp, Context, Reader};
use tokio_modbus::Slave;

const UNIT: Slave = Slave(17);
const ADDRESS: u16 = 7;
const QUANTITY: u16 = 10;

/// Makes transactions. Fills `taken` with the microseconds of each, if there is one.
async fn run(client: &mut Context, count: u64, mut taken: Option<&mut Vec<f64>>) {
    let mut from = Instant::now();
    for _ in 0..count {
        let reply = client.read_holding_registers(ADDRESS, QUANTITY).await;
        let words = reply.expect("a reply").expect("no exception");
        assert!(words.len() == usize::from(QUANTITY));
        if let Some(taken) = &mut taken {
            let now = Instant::now();
            taken.push((now - from).as_secs_f64() * 1e6);
            from = now;
        }
    }
}

async fn run_rounds(client: &mut Context) {
    for line in std::io::stdin().lock().lines() {
        let count = line.expect("a line").trim().parse().expect("a count");
        let mut taken = Vec::with_capacity(100_000);
        let start = Instant::now();
        run(client, count, Some(&mut taken)).await;
        let seconds = start.elapsed().as_secs_f64();
        taken.sort_by(f64::total_cmp);
        let part = |percent| taken[taken.len() * percent / 100];
        println!("{seconds:.6}\t{:.1}\t{:.1}", part(50), part(99));
        std::io::stdout().flush().expect("an output");
    }
}

async fn begin(port: &str, what: &str) {
    let port = port.parse().expect("a port");
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let stream = TcpStream::connect(address).await.expect("a connection");
    stream.set_nodelay(true).expect("a socket");
    let mut client = tcp::attach_slave(stream, UNIT);
    if what == "rounds" {
        run_rounds(&mut client).await;
    } else {
        run(&mut client, what.parse().expect("a count"), None).await;
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [port, what] = &arguments[..] else {
        eprintln!("usage: tokio_client PORT COUNT | PORT rounds");
        std::process::exit(2);
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .build();
    runtime.expect("a runtime").block_on(begin(port, what));
}
