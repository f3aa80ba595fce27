//! The client with futures against servers of tokio-modbus, which take their time, and whose replies the
//! program often does not wait for.

use embedded_io_adapters::tokio_1::FromTokio;
use mbm::client::{AsyncClient, Call, Transport};
use mbm::port::AsyncIo;
use mbm_host_example::{micros, Delay};
use std::future::Future;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::pin::Pin;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Mutex;
use tokio::time::{sleep, timeout};
use tokio_modbus::server::{rtu_over_tcp, tcp, Service};
use tokio_modbus::{ExceptionCode, Request, Response};

fn value(address: u16) -> u16 {
    address.wrapping_mul(40503).wrapping_add(0x1234)
}

/// A device whose registers have their [`value`], and which answers after up to 15 ms.
#[derive(Clone)]
struct Registers;

impl Service for Registers {
    type Request = Request<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Pin<Box<dyn Future<Output = Result<Response, ExceptionCode>> + Send>>;

    fn call(&self, request: Self::Request) -> Self::Future {
        Box::pin(async move {
            match request {
                Request::ReadHoldingRegisters(address, quantity) => {
                    sleep(Duration::from_millis((address % 16).into())).await;
                    let values = (address..address + quantity).map(value);
                    Ok(Response::ReadHoldingRegisters(values.collect()))
                }
                Request::WriteMultipleRegisters(address, values) => Ok(
                    Response::WriteMultipleRegisters(address, values.len() as u16),
                ),
                _ => Err(ExceptionCode::IllegalFunction),
            }
        })
    }
}

/// Starts a server, and returns its address.
async fn serve(has_rtu_frames: bool) -> SocketAddr {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
        .await
        .expect("a port");
    let address = listener.local_addr().expect("an address");
    tokio::spawn(async move {
        let error = |error: io::Error| panic!("the server: {error}");
        if has_rtu_frames {
            let accept = |stream, address| async move {
                rtu_over_tcp::accept_tcp_connection(stream, address, |_| Ok(Some(Registers)))
            };
            let server = rtu_over_tcp::Server::new(listener);
            server.serve(&accept, error).await
        } else {
            let accept = |stream, address| async move {
                tcp::accept_tcp_connection(stream, address, |_| Ok(Some(Registers)))
            };
            tcp::Server::new(listener).serve(&accept, error).await
        }
    });
    address
}

type Io = AsyncIo<FromTokio<TcpStream>, fn() -> u32, Delay>;

async fn connect(address: SocketAddr) -> Io {
    let socket = TcpStream::connect(address).await.expect("a connection");
    AsyncIo::stream(FromTokio::new(socket), micros, Delay)
}

/// Two tasks share a client, and drop the futures of two requests of three. Each reply that they get is
/// that to their own request, and they get some.
async fn share<L>(mut client: AsyncClient<L>, response_timeout_ms: u32, limit_ms: u64)
where
    L: Transport<Call, Port = Io> + Send + 'static,
{
    client
        .settings()
        .response_timeout
        .set_timeout(response_timeout_ms)
        .expect("a timeout");
    let client = Arc::new(Mutex::new(client));
    let tasks = [1000u16, 2000].map(|from| {
        let client = client.clone();
        tokio::spawn(async move {
            let mut read = 0;
            for at in 0..150 {
                let address = from + 7 * at;
                let mut client = client.lock().await;
                let limit = Duration::from_millis([2, 5, limit_ms][usize::from(at) % 3]);
                match timeout(limit, client.holding_registers::<3>(17, address)).await {
                    Ok(Ok(values)) => {
                        assert_eq!(values, [0, 1, 2].map(|more| value(address + more)));
                        read += 1;
                    }
                    Ok(Err(mbm::Error::ResponseTimedOut)) | Err(_) => {}
                    Ok(Err(error)) => panic!("{error}"),
                }
            }
            read
        })
    });
    for task in tasks {
        let read = task.await.expect("the task");
        assert!(read > 0);
    }
    let mut client = client.lock().await;
    client.policy().retries = 20;
    let written = client.write_multiple_registers(17, 3, &[7; 100]).await;
    assert_eq!(written, Ok(()));
    let refused = client.coils::<1>(17, 3).await;
    assert_eq!(refused, Err(mbm::Error::IllegalFunction));
}

#[tokio::test]
async fn two_tasks_share_a_connection_to_a_tokio_modbus_server_and_drop_their_futures() {
    let client = AsyncClient::tcp(connect(serve(false).await).await);
    // The server answers the requests that were dropped, too, one after the other.
    share(client, 5_000, 20_000).await;
}

#[tokio::test]
async fn two_tasks_share_rtu_frames_to_a_tokio_modbus_server_and_drop_their_futures() {
    let client = AsyncClient::rtu_over_tcp(connect(serve(true).await).await);
    // The client waits for twice as long for the reply to a request that was dropped.
    share(client, 50, 500).await;
}

#[tokio::test]
async fn the_programs_read_two_registers_of_tokio_modbus_servers() {
    for (program, has_rtu_frames) in [
        (env!("CARGO_BIN_EXE_read_tcp_async"), false),
        (env!("CARGO_BIN_EXE_read_rtu_over_tcp_async"), true),
    ] {
        let address = serve(has_rtu_frames).await.to_string();
        let output = tokio::task::spawn_blocking(move || {
            Command::new(program)
                .arg(address)
                .output()
                .expect("it runs")
        });
        let output = output.await.expect("an output");
        let printed = String::from_utf8_lossy(&output.stdout);
        assert_eq!(printed, format!("{} {}\n", value(107), value(108)));
    }
}

#[tokio::test]
async fn a_connection_that_the_server_closes_is_lost_and_one_in_its_place_is_used() {
    let address = serve(false).await;
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
        .await
        .expect("a port");
    let closing = listener.local_addr().expect("an address");
    let mut client = AsyncClient::tcp(connect(closing).await);
    drop(listener.accept().await.expect("a connection"));
    for _ in 0..2 {
        let lost = client.holding_registers::<2>(17, 107).await;
        assert_eq!(lost, Err(mbm::Error::LinkLost));
    }
    let socket = TcpStream::connect(address).await.expect("a connection");
    client.port().device = FromTokio::new(socket);
    client.reconnect();
    let read = client.holding_registers(17, 107).await;
    assert_eq!(read, Ok([value(107), value(108)]));
}
