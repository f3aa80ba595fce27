//! The ways in which a program in Rust names the types: in a struct, in a static, for tasks and
//! threads.
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async"))]

use embedded_hal_async::delay::DelayNs;
use mbm::client::{AsyncClient, Call, Client, Frame, Request, Serial, Tcp, TcpBuffers};
use mbm::master::{AsyncMaster, Buffers, Master};
use mbm::pdu::identification::DeviceIdCode;
use mbm::port::{AsyncIo, EmbeddedIo};
use mbm::server::Server;
use mbm::{Error, Status};
use std::convert::Infallible;
use std::fmt::Debug;
use std::sync::Mutex;

/// A UART that has no bytes and takes none.
#[derive(Debug)]
struct Uart;

impl embedded_io::ErrorType for Uart {
    type Error = Infallible;
}

impl embedded_io::Read for Uart {
    fn read(&mut self, _: &mut [u8]) -> Result<usize, Infallible> {
        Ok(0)
    }
}

impl embedded_io::ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(false)
    }
}

impl embedded_io::Write for Uart {
    fn write(&mut self, _: &[u8]) -> Result<usize, Infallible> {
        Ok(0)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl embedded_io::WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(false)
    }
}

impl embedded_io_async::Read for Uart {
    async fn read(&mut self, _: &mut [u8]) -> Result<usize, Infallible> {
        Ok(0)
    }
}

impl embedded_io_async::Write for Uart {
    async fn write(&mut self, _: &[u8]) -> Result<usize, Infallible> {
        Ok(0)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

#[derive(Debug)]
struct Delay;

impl DelayNs for Delay {
    async fn delay_ns(&mut self, _: u32) {}
}

type Port = EmbeddedIo<Uart, fn() -> u32>;
type Io = AsyncIo<Uart, fn() -> u32, Delay>;
type AsyncRtu = AsyncClient<Serial<Io, Frame<[u8; 256]>, Call>>;
type AsyncAscii = AsyncClient<Serial<Io, Frame<[u8; 513]>, Call>>;
type AsyncTcp = AsyncClient<Tcp<Io, TcpBuffers<[u8; 260], [u8; 260]>>>;
type Words = Buffers<[u8; 64], [u16; 20], [u16; 20]>;
type Rtu = Client<Serial<Port, Frame<[u8; 256]>, Request<'static>>, Request<'static>, 2>;
type TcpIp = Client<Tcp<Port, TcpBuffers<[u8; 260], [u8; 260]>>, Request<'static>, 2>;

fn micros() -> u32 {
    7
}

/// The objects of a program, all made at compile time.
#[derive(Debug)]
struct App {
    master: Master<Port, Words>,
    awaited: AsyncMaster<Uart, fn() -> u32, Delay, Words>,
    async_rtu: AsyncRtu,
    async_ascii: AsyncAscii,
    async_rtu_over_tcp: AsyncRtu,
    async_tcp: AsyncTcp,
    rtu: Rtu,
    tcp: TcpIp,
    server: Server<Port, [u8; 256]>,
}

static APP: Mutex<App> = Mutex::new(App {
    master: Master::new(
        17,
        EmbeddedIo::serial(Uart, micros),
        Buffers::new([0; 64], [0; 20], [0; 20]),
    ),
    awaited: AsyncMaster::new(
        17,
        Uart,
        micros,
        Delay,
        Buffers::new([0; 64], [0; 20], [0; 20]),
    ),
    async_rtu: AsyncClient::rtu(AsyncIo::serial(Uart, micros, Delay)),
    async_ascii: AsyncClient::ascii(AsyncIo::serial(Uart, micros, Delay)),
    async_rtu_over_tcp: AsyncClient::rtu_over_tcp(AsyncIo::stream(Uart, micros, Delay)),
    async_tcp: AsyncClient::tcp(AsyncIo::stream(Uart, micros, Delay)),
    rtu: Client::new(Serial::new(
        EmbeddedIo::serial(Uart, || 8),
        Frame::new([0; 256]),
    )),
    tcp: Client::new(Tcp::new(
        EmbeddedIo::stream(Uart, micros),
        TcpBuffers::new([0; 260], [0; 260]),
    )),
    server: Server::new(EmbeddedIo::serial(Uart, micros), [0; 256]),
});

#[test]
fn a_static_holds_master_client_and_server() {
    let app = &mut *APP.lock().unwrap();
    app.master.settings().set_baud_rate(19_200);
    app.rtu.settings().set_baud_rate(19_200);
    assert_eq!(app.rtu.settings(), app.master.settings());
    app.awaited.set_unit(18);
    app.async_rtu.settings().set_baud_rate(19_200);
    app.async_ascii.settings().set_baud_rate(9_600);
    app.async_rtu_over_tcp.reconnect();
    assert_eq!(app.async_tcp.unanswered(), 0);
    assert_eq!(mbm::port::Port::micros(app.master.port()), 7);
    assert_eq!(mbm::port::Port::micros(app.rtu.port()), 8);
    assert_eq!(app.rtu.poll_delay(0), u32::MAX);
    assert_eq!(app.tcp.pending(), 0);
    app.server.begin_rtu();
    assert_eq!(app.server.poll(0), Status::OK);
    assert!(format!("{app:?}").contains("master: Master"));
}

#[test]
fn a_thread_or_task_may_take_each_object() {
    fn may_be_taken<T: Send + Sync + Debug + 'static>() {}
    may_be_taken::<App>();
    may_be_taken::<Error>();
    may_be_taken::<Status>();
    fn may_be_moved<T: Send>(_: T) {}
    may_be_moved(async {
        let buffers = Buffers::new([0; 64], [0; 20], [0; 20]);
        let mut master = AsyncMaster::new(17, Uart, micros, Delay, buffers);
        master.read_holding_registers(107, &mut [0; 2]).await
    });
    may_be_moved(async {
        let mut client = AsyncClient::tcp(AsyncIo::stream(Uart, micros, Delay));
        client.read_holding_registers(17, 107, &mut [0; 2]).await?;
        client.identify(17, DeviceIdCode::Basic, |_, _| {}).await
    });
}

#[test]
fn a_frame_buffer_of_13_bytes_and_the_words_holds_every_request() {
    for words in [1, 5, 121] {
        let buffers = Buffers::new(vec![0; 13 + 2 * words], vec![0; words], vec![0; words]);
        let mut master = Master::new(17, EmbeddedIo::serial(Uart, micros as fn() -> u32), buffers);
        let (quantity, values) = (words as u16, vec![7; words]);
        assert_eq!(master.start_read_holding_registers(0, quantity), Ok(()));
        master.cancel();
        assert_eq!(master.start_write_multiple_registers(0, &values), Ok(()));
        master.cancel();
        let both = master.start_read_write_multiple_registers(0, quantity, 0, &values);
        assert_eq!(both, Ok(()));
    }
}
