//! Clients whose functions are futures, of each framing.

use super::awaited::{Delay, Link, Socket};
use mbm::port::AsyncIo;

/// The response timeout of the clients.
pub const TIMEOUT: u32 = 100_000;

pub type Io = AsyncIo<Socket, Box<dyn FnMut() -> u32>, Delay, Box<dyn FnMut(bool)>>;

/// The port of a link. A stream has no driver.
pub fn io(link: &Link) -> Io {
    let (socket, delay) = (Socket(link.clone()), Delay(link.clone()));
    let (clock, driver) = (link.clone(), link.clone());
    let clock = Box::new(move || clock.borrow().now);
    let driver = Box::new(move |on| driver.borrow_mut().driver = on);
    AsyncIo::serial_with_driver(socket, clock, delay, driver)
}

pub type Stream = AsyncIo<Socket, Box<dyn FnMut() -> u32>, Delay>;

pub fn stream(link: &Link) -> Stream {
    let clock = link.clone();
    let clock: Box<dyn FnMut() -> u32> = Box::new(move || clock.borrow().now);
    AsyncIo::stream(Socket(link.clone()), clock, Delay(link.clone()))
}

/// A client whose calls end in 100 ms, on a serial line at 115 200 baud.
macro_rules! ready {
    ($client:expr) => {{
        let mut client = $client;
        client.settings().set_baud_rate(115_200);
        client.settings().response_timeout = MicrosSetting::new(TIMEOUT);
        client
    }};
}

/// Does the same with a client of each framing that a stream carries.
macro_rules! on_streams {
    ($link:ident, $client:ident, $body:block) => {
        for at in 0..3 {
            match at {
                0 => {
                    let $link = Net::new(Framing::Tcp, false);
                    #[allow(unused_mut)]
                    let mut $client = ready!(AsyncClient::tcp(stream(&$link)));
                    $body
                }
                1 => {
                    let $link = Net::new(Framing::RtuOverTcp, false);
                    #[allow(unused_mut)]
                    let mut $client = ready!(AsyncClient::rtu_over_tcp(stream(&$link)));
                    $body
                }
                _ => {
                    let $link = Net::new(Framing::Ascii, false);
                    #[allow(unused_mut)]
                    let mut $client = ready!(AsyncClient::ascii(stream(&$link)));
                    $body
                }
            }
        }
    };
}

/// Does the same with a client of each framing of a serial line.
macro_rules! on_lines {
    ($link:ident, $client:ident, $body:block) => {
        for at in 0..2 {
            match at {
                0 => {
                    let $link = Net::new(Framing::Rtu, true);
                    let mut $client = ready!(AsyncClient::rtu(io(&$link)));
                    $body
                }
                _ => {
                    let $link = Net::new(Framing::Ascii, true);
                    let mut $client = ready!(AsyncClient::ascii(io(&$link)));
                    $body
                }
            }
        }
    };
}

/// Does the same with a client of each framing.
macro_rules! on_each {
    ($link:ident, $client:ident, $body:block) => {
        on_streams!($link, $client, $body);
        on_lines!($link, $client, $body);
    };
}
