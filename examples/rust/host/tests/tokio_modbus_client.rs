//! Clients of tokio-modbus at the programs that serve on tokio.

use embedded_io_adapters::tokio_1::FromTokio;
use mbm::port::AsyncIo;
use mbm::server::{AsyncServer, Tables, Unit};
use mbm_host_example::{micros, Delay};
use std::io::{BufRead, BufReader};
use std::net::{Ipv4Addr, SocketAddr};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::yield_now;

use tokio_modbus::client::{rtu, tcp, Client, Context, Reader, Writer};
use tokio_modbus::prelude::SlaveContext;
use tokio_modbus::{ExceptionCode, Request, Response, Slave};

/// A program that serves, which is ended with its value.
struct Server {
    child: Child,
    address: SocketAddr,
}

impl Server {
    fn start(program: &str) -> Server {
        let mut child = Command::new(program)
            .arg("127.0.0.1:0")
            .stdout(Stdio::piped())
            .spawn()
            .expect("it runs");
        let mut line = String::new();
        let output = child.stdout.take().expect("the output");
        BufReader::new(output).read_line(&mut line).expect("a line");
        let address = line.trim_end().parse().expect("an address");
        Server { child, address }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

async fn connect(server: &Server) -> Context {
    let client = tcp::connect_slave(server.address, Slave(17)).await;
    client.expect("a connection")
}

#[tokio::test]
async fn tasks_with_a_client_each_read_and_write_a_server() {
    let server = Server::start(env!("CARGO_BIN_EXE_serve_tcp_async"));
    let mut client = connect(&server).await;
    let read = client.read_holding_registers(107, 4).await;
    assert_eq!(read.unwrap(), Ok(vec![555, 100, 0, 0]));
    let tasks = [109u16, 110].map(|address| {
        let server = server.address;
        tokio::spawn(async move {
            let client = tcp::connect_slave(server, Slave(17)).await;
            let mut client = client.expect("a connection");
            for value in 1..=200 {
                let written = client.write_single_register(address, value).await;
                assert_eq!(written.unwrap(), Ok(()));
                let read = client.read_holding_registers(address, 1).await;
                assert_eq!(read.unwrap(), Ok(vec![value]));
            }
        })
    });
    for task in tasks {
        task.await.expect("the task");
    }
    let read = client.read_holding_registers(109, 2).await;
    assert_eq!(read.unwrap(), Ok(vec![200, 200]));
    let masked = client.masked_write_register(110, 0xFF00, 0x0055).await;
    assert_eq!(masked.unwrap(), Ok(()));
    let both = client
        .read_write_multiple_registers(107, 4, 109, &[1])
        .await;
    assert_eq!(both.unwrap(), Ok(vec![555, 100, 1, 0x55]));
}

#[tokio::test]
async fn a_client_gets_the_exceptions_of_a_server() {
    let server = Server::start(env!("CARGO_BIN_EXE_serve_tcp_async"));
    let mut client = connect(&server).await;
    let read = client.read_holding_registers(108, 4).await;
    assert_eq!(read.unwrap(), Err(ExceptionCode::IllegalDataAddress));
    let read = client.read_coils(0, 1).await;
    assert_eq!(read.unwrap(), Err(ExceptionCode::IllegalFunction));
    let request = Request::Custom(0x66, vec![1, 2, 3].into());
    let answer = client.call(request).await;
    assert_eq!(answer.unwrap(), Err(ExceptionCode::IllegalFunction));
}

#[tokio::test]
async fn a_client_of_another_unit_gets_no_answer() {
    let server = Server::start(env!("CARGO_BIN_EXE_serve_tcp_async"));
    let mut client = connect(&server).await;
    client.set_slave(Slave(18));
    let read = client.read_holding_registers(107, 4);
    let limit = Duration::from_millis(200);
    assert!(tokio::time::timeout(limit, read).await.is_err());
    // The connection is as good as before.
    let mut client = connect(&server).await;
    let read = client.read_holding_registers(107, 1).await;
    assert_eq!(read.unwrap(), Ok(vec![555]));
}

/// Yields to the other tasks of the executor `times` times.
async fn yield_times(times: u32) {
    for _ in 0..times {
        yield_now().await;
    }
}

#[tokio::test]
async fn a_server_whose_future_is_dropped_again_and_again_answers_each_request() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let address = listener.local_addr().unwrap();
    let serving = tokio::spawn(async move {
        let socket = FromTokio::new(listener.accept().await.unwrap().0);
        let mut server = AsyncServer::tcp(AsyncIo::stream(socket, micros, Delay));
        let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(0, [0; 123]));
        let mut dropped = 0;
        loop {
            tokio::select! {
                lost = server.run(&mut unit) => return (lost, dropped),
                () = yield_times(dropped % 5) => dropped += 1,
            }
        }
    });
    let mut client = tcp::connect_slave(address, Slave(17)).await.unwrap();
    for value in 0..300 {
        let values = vec![value; 123];
        let written = client.write_multiple_registers(0, &values).await;
        assert_eq!(written.unwrap(), Ok(()));
        let read = client.read_holding_registers(0, 123).await;
        assert_eq!(read.unwrap(), Ok(values));
    }
    client.disconnect().await.expect("it ends");
    let (lost, dropped) = serving.await.expect("the task");
    assert_eq!(lost, mbm::Error::LinkLost);
    assert!(dropped > 100, "{dropped}");
}

#[tokio::test]
async fn a_client_that_sends_rtu_frames_through_tcp_reads_a_server() {
    let server = Server::start(env!("CARGO_BIN_EXE_serve_rtu_over_tcp_async"));
    let stream = TcpStream::connect(server.address).await;
    let mut client = rtu::attach_slave(stream.expect("a connection"), Slave(17));
    for value in 201..=203 {
        let request = Request::ReadInputRegisters(0, 1);
        let response = client.call(request).await;
        let expected = Response::ReadInputRegisters(vec![value]);
        assert_eq!(response.unwrap(), Ok(expected));
    }
    let read = client.read_input_registers(1, 1).await;
    assert_eq!(read.unwrap(), Err(ExceptionCode::IllegalDataAddress));
}

#[tokio::test]
async fn a_server_outlives_clients_that_leave_in_the_middle_of_a_request() {
    let server = Server::start(env!("CARGO_BIN_EXE_serve_tcp_async"));
    for at in 0..12 {
        let stream = TcpStream::connect(server.address).await.unwrap();
        let request = [0, 1, 0, 0, 0, 6, 17, 3, 0, 107, 0, 4];
        stream.writable().await.expect("it can be written");
        assert_eq!(stream.try_write(&request[..at]).ok(), Some(at));
    }
    let mut client = connect(&server).await;
    let read = client.read_holding_registers(107, 1).await;
    assert_eq!(read.unwrap(), Ok(vec![555]));
}
