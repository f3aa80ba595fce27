//! The client with futures, on simulated links with a device.
#![cfg(feature = "embedded-io-async")]

#[path = "common/awaited.rs"]
mod awaited;
#[macro_use]
#[path = "common/awaited_clients.rs"]
mod awaited_clients;
#[path = "common/frame.rs"]
mod frame;

use awaited::{drop_when, poll, run, run_for, value, Link, Net, Socket, UNIT};
use awaited_clients::{io, stream, TIMEOUT};
use frame::framed;
use mbm::client::{AsyncClient, Call, TcpBuffers, TolerantTcp, ACCEPT_TRANSACTION};
use mbm::engine::MicrosSetting;
use mbm::frame::Framing;
use mbm::Error;
use std::pin::pin;

#[test]
fn registers_are_read_and_written_in_each_framing() {
    on_each!(link, client, {
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107), value(108)]));
        let write = client.write_multiple_registers(UNIT, 3, &[7; 123]);
        assert_eq!(run(&link, write), Ok(()));
        let mut words = [0; 125];
        let read = client.read_input_registers(UNIT, 1000, &mut words);
        assert_eq!(run(&link, read), Ok(()));
        assert!((1000..).zip(words).all(|(at, word)| word == value(at)));
        let refused = run(&link, client.coils::<3>(UNIT, 0));
        assert_eq!(refused, Err(Error::IllegalFunction));
        assert_eq!(link.borrow().requests.len(), 4);
    });
}

#[test]
fn a_frame_that_was_half_sent_when_its_future_was_dropped_is_sent_before_the_next_one() {
    on_streams!(link, client, {
        for taken in 1..8 {
            let before = link.borrow().sent;
            link.borrow_mut().budget = taken;
            let write = client.write_multiple_registers(UNIT, 3, &[7; 20]);
            drop_when(&link, write, |net| net.sent == before + taken);
            for _ in 0..10 {
                link.borrow_mut().now += 100;
            }
            assert_eq!(link.borrow().sent, before + taken);
            link.borrow_mut().budget = usize::MAX;
            let read = run(&link, client.holding_registers(UNIT, 107));
            assert_eq!(read, Ok([value(107), value(108)]));
            let requests = std::mem::take(&mut link.borrow_mut().requests);
            assert_eq!(requests.len(), 2);
            assert_eq!((requests[0][1], requests[1][1]), (16, 3));
        }
    });
}

#[test]
fn the_rest_of_a_frame_is_sent_also_if_several_futures_are_dropped_on_the_way() {
    on_streams!(link, client, {
        link.borrow_mut().budget = 3;
        let write = client.write_multiple_registers(UNIT, 3, &[7; 20]);
        drop_when(&link, write, |net| net.sent == 3);
        for sent in 4..10 {
            link.borrow_mut().budget = 1;
            let read = client.holding_registers::<2>(UNIT, 107);
            drop_when(&link, read, |net| net.sent == sent);
            assert!(link.borrow().requests.is_empty());
        }
        link.borrow_mut().budget = usize::MAX;
        let read = run(&link, client.holding_registers(UNIT, 50));
        assert_eq!(read, Ok([value(50)]));
        let functions: Vec<u8> = link.borrow().requests.iter().map(|one| one[1]).collect();
        assert_eq!(functions, [16, 3]);
    });
}

#[test]
fn a_frame_that_a_uart_still_sends_when_its_future_is_dropped_is_not_run_into_by_the_next_one() {
    for part in [3, 8] {
        on_lines!(link, client, {
            // At a low rate, a frame takes longer than the quiet time.
            client.settings().quiet_time = MicrosSetting::new(1_000);
            link.borrow_mut().flush_waits = true;
            link.borrow_mut().budget = part;
            let write = client.write_single_register(18, 3, 7);
            drop_when(&link, write, |net| net.sent == part);
            link.borrow_mut().budget = usize::MAX;
            let sent = link.borrow().sent;
            let read = run_for(&link, client.holding_registers::<1>(UNIT, 107), 90_000);
            assert_eq!((read, link.borrow().sent), (None, sent));
            link.borrow_mut().flush_waits = false;
            let read = run(&link, client.holding_registers(UNIT, 107));
            assert_eq!(read, Ok([value(107)]));
        });
    }
}

#[test]
fn the_reply_to_a_frame_that_was_sent_late_is_not_delivered_to_the_next_request() {
    on_streams!(link, client, {
        link.borrow_mut().budget = 7;
        let read = client.holding_registers::<2>(UNIT, 107);
        drop_when(&link, read, |net| net.sent == 7);
        // Any reply would have come by now.
        link.borrow_mut().now += 10 * TIMEOUT;
        link.borrow_mut().budget = usize::MAX;
        link.borrow_mut().latency = 30_000;
        let read = run(&link, client.holding_registers(UNIT, 50));
        assert_eq!(read, Ok([value(50), value(51)]));
    });
}

#[test]
fn the_reply_to_a_frame_that_was_sent_late_is_not_taken_by_a_client_that_accepts_any_transaction() {
    let link = Net::new(Framing::Tcp, false);
    let mut line = TolerantTcp::new(stream(&link), TcpBuffers::new([0; 260], [0; 260]));
    assert!(line.set_accept(ACCEPT_TRANSACTION));
    let mut client: AsyncClient<_> = ready!(AsyncClient::new(line));
    link.borrow_mut().budget = 7;
    let read = client.holding_registers::<2>(UNIT, 107);
    drop_when(&link, read, |net| net.sent == 7);
    link.borrow_mut().now += 10 * TIMEOUT;
    link.borrow_mut().budget = usize::MAX;
    link.borrow_mut().latency = 30_000;
    let read = run(&link, client.holding_registers(UNIT, 50));
    assert_eq!(read, Ok([value(50), value(51)]));
}

#[test]
fn a_frame_that_stays_half_sent_is_a_lost_link_until_it_is_opened_anew() {
    on_streams!(link, client, {
        link.borrow_mut().budget = 5;
        let write = client.write_single_register(UNIT, 3, 7);
        drop_when(&link, write, |net| net.sent == 5);
        for _ in 0..3 {
            let read = run(&link, client.holding_registers::<1>(UNIT, 107));
            assert_eq!(read, Err(Error::LinkLost));
            // The rest can be sent again: the link stays lost all the same.
            link.borrow_mut().budget = usize::MAX;
            assert_eq!(link.borrow().sent, 5);
        }
        link.borrow_mut().reopen();
        client.port().device = Socket(link.clone());
        client.reconnect();
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107)]));
        assert_eq!(link.borrow().requests.len(), 1);
    });
}

#[test]
fn a_request_of_which_nothing_was_sent_when_its_future_was_dropped_is_not_sent() {
    on_each!(link, client, {
        link.borrow_mut().accepts = 0;
        let write = client.write_single_register(UNIT, 3, 7);
        assert_eq!(run_for(&link, write, 10_000), None);
        link.borrow_mut().accepts = usize::MAX;
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107)]));
        assert_eq!(link.borrow().requests.len(), 1);
        assert!(!link.borrow().driver);
    });
}

#[test]
fn a_late_reply_to_a_dropped_request_is_not_delivered_to_the_next_one() {
    // The reply comes while the next request waits, is sent, and waits for its own.
    for latency in [500, 5_000, 30_000, 80_000, 150_000, 190_000] {
        on_each!(link, client, {
            link.borrow_mut().latency = latency;
            let read = client.holding_registers::<2>(UNIT, 107);
            drop_when(&link, read, |net| !net.requests.is_empty());
            link.borrow_mut().latency = 1_000;
            // A stream keeps the order of the replies, so the one of the next request may be late too.
            let mut reads = (50..53).map(|at| (at, run(&link, client.holding_registers(UNIT, at))));
            let (at, read) = reads.find(|(_, read)| read.is_ok()).expect("a reply");
            assert_eq!(read, Ok([value(at), value(at + 1)]), "{latency}");
        });
    }
}

#[test]
fn a_late_reply_to_a_request_that_timed_out_is_not_delivered_to_the_next_one() {
    on_each!(link, client, {
        link.borrow_mut().latency = 150_000;
        let read = run(&link, client.holding_registers::<1>(UNIT, 107));
        assert_eq!(read, Err(Error::ResponseTimedOut));
        link.borrow_mut().latency = 1_000;
        let read = run(&link, client.holding_registers(UNIT, 50));
        assert_eq!(read, Ok([value(50)]));
    });
}

#[test]
fn a_reply_of_another_unit_or_transaction_is_not_taken() {
    let link = Net::new(Framing::Tcp, false);
    let mut client = ready!(AsyncClient::tcp(stream(&link)));
    link.borrow_mut().is_silent = true;
    for (transaction, unit) in [(9, UNIT), (0, 18), (0, 0)] {
        let reply = framed(Framing::Tcp, transaction, unit, &[3, 2, 0xBA, 0xD0]);
        link.borrow_mut().arrive(0, &reply);
    }
    let read = client.holding_registers::<1>(UNIT, 107);
    assert_eq!(run(&link, read), Err(Error::InvalidSlaveId));
    link.borrow_mut().is_silent = false;
    let read = run(&link, client.holding_registers(UNIT, 107));
    assert_eq!(read, Ok([value(107)]));
}

#[test]
fn a_link_that_closes_in_the_middle_of_a_reply_is_lost_until_it_is_opened_anew() {
    on_streams!(link, client, {
        link.borrow_mut().is_silent = true;
        let reply = framed(link.borrow().framing, 0, UNIT, &[3, 4, 0, 1, 0, 2]);
        link.borrow_mut().arrive(2_000, &reply[..6]);
        let mut read = Box::pin(client.holding_registers::<2>(UNIT, 107));
        while !link.borrow().arriving.is_empty() {
            assert!(poll(read.as_mut()).is_pending());
            link.borrow_mut().now += 100;
        }
        link.borrow_mut().is_closed = true;
        assert_eq!(run(&link, read), Err(Error::LinkLost));
        let sent = link.borrow().sent;
        // A program that repeats the request does not send it into a connection that is closed, nor
        // into another one that it has not told the client of.
        for closed in [true, false] {
            link.borrow_mut().is_closed = closed;
            let read = run(&link, client.holding_registers::<2>(UNIT, 107));
            assert_eq!(read, Err(Error::LinkLost));
        }
        assert_eq!(link.borrow().sent, sent);
        link.borrow_mut().reopen();
        link.borrow_mut().is_silent = false;
        client.reconnect();
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107)]));
    });
}

#[test]
fn a_connection_that_was_closed_between_two_requests_gets_no_byte_of_the_second_one() {
    on_streams!(link, client, {
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107)]));
        let sent = link.borrow().sent;
        link.borrow_mut().is_closed = true;
        let write = run(&link, client.write_single_register(UNIT, 107, 1));
        assert_eq!(write, Err(Error::LinkLost));
        assert_eq!(link.borrow().sent, sent);
    });
}

#[test]
fn a_reply_after_which_the_device_closes_the_link_is_delivered() {
    on_streams!(link, client, {
        let mut read = pin!(client.holding_registers(UNIT, 107));
        while link.borrow().requests.is_empty() {
            assert!(poll(read.as_mut()).is_pending());
            link.borrow_mut().now += 100;
        }
        link.borrow_mut().is_closed = true;
        link.borrow_mut().now += 10_000;
        assert_eq!(run(&link, read), Ok([value(107), value(108)]));
    });
}

#[test]
fn a_device_that_never_answers_times_out_and_is_heard_again() {
    on_each!(link, client, {
        link.borrow_mut().is_silent = true;
        client.policy().retries = 2;
        let begun = link.borrow().now;
        let read = run(&link, client.holding_registers::<1>(UNIT, 107));
        assert_eq!(read, Err(Error::ResponseTimedOut));
        let passed = link.borrow().now - begun;
        assert!((300_000..900_000).contains(&passed), "{passed}");
        assert_eq!(link.borrow().requests.len(), 3);
        assert_eq!(client.unanswered(), 3);
        link.borrow_mut().is_silent = false;
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107)]));
    });
}

#[test]
fn a_write_that_never_becomes_ready_ends_its_request_in_time() {
    on_streams!(link, client, {
        link.borrow_mut().accepts = 0;
        let write = client.write_single_register(UNIT, 3, 7);
        let result = run_for(&link, write, 3 * TIMEOUT);
        assert_eq!(result, Some(Err(Error::LinkLost)));
    });
    on_lines!(link, client, {
        link.borrow_mut().accepts = 0;
        let write = client.write_single_register(UNIT, 3, 7);
        let result = run_for(&link, write, 5 * TIMEOUT);
        assert_eq!(result, Some(Err(Error::LineBusy)));
        assert!(!link.borrow().driver);
        // The next request tries again.
        link.borrow_mut().accepts = 8;
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107)]));
    });
}

#[test]
fn a_flush_that_never_ends_ends_its_request_in_time() {
    on_each!(link, client, {
        link.borrow_mut().flush_waits = true;
        let write = client.write_single_register(UNIT, 3, 7);
        let result = run_for(&link, write, 5 * TIMEOUT);
        assert!(matches!(
            result,
            Some(Err(Error::LineBusy | Error::LinkLost))
        ));
        link.borrow_mut().flush_waits = false;
        link.borrow_mut().reopen();
        client.reconnect();
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107)]));
    });
}

#[test]
fn a_write_may_take_one_byte_at_a_time() {
    on_each!(link, client, {
        link.borrow_mut().accepts = 1;
        let write = client.write_multiple_registers(UNIT, 3, &[7; 100]);
        assert_eq!(run(&link, write), Ok(()));
    });
}

#[test]
fn a_read_that_fails_is_a_lost_link_on_a_stream_and_a_damaged_character_on_a_line() {
    on_streams!(link, client, {
        link.borrow_mut().read_fails = true;
        for _ in 0..2 {
            let write = run(&link, client.write_single_register(UNIT, 3, 7));
            assert_eq!(write, Err(Error::LinkLost));
        }
        client.reconnect();
        assert_eq!(run(&link, client.write_single_register(UNIT, 3, 7)), Ok(()));
    });
    on_lines!(link, client, {
        link.borrow_mut().read_fails = true;
        assert_eq!(run(&link, client.write_single_register(UNIT, 3, 7)), Ok(()));
    });
}

#[test]
fn a_line_whose_reads_always_fail_does_not_keep_other_tasks_from_running() {
    on_lines!(link, client, {
        let mut write = pin!(client.write_single_register(UNIT, 3, 7));
        let mut polls = 0;
        let result = loop {
            link.borrow_mut().read_fails = true;
            link.borrow_mut().arriving.clear();
            match poll(write.as_mut()) {
                std::task::Poll::Ready(result) => break result,
                std::task::Poll::Pending => polls += 1,
            }
            link.borrow_mut().now += 100;
        };
        assert_eq!(result, Err(Error::ResponseTimedOut));
        assert!(polls > 500);
    });
}

#[test]
fn a_write_or_flush_that_fails_is_a_lost_link_which_a_line_tries_again() {
    for flushes in [false, true] {
        on_each!(link, client, {
            link.borrow_mut().write_fails = !flushes;
            link.borrow_mut().flush_fails = flushes;
            let write = run(&link, client.write_single_register(UNIT, 3, 7));
            assert_eq!(write, Err(Error::LinkLost));
            link.borrow_mut().write_fails = false;
            link.borrow_mut().flush_fails = false;
            let again = run(&link, client.write_single_register(UNIT, 3, 7));
            assert_eq!(again.is_ok(), link.borrow().is_serial);
        });
    }
}

#[test]
fn a_request_that_is_dropped_at_any_time_leaves_the_client_usable() {
    on_each!(link, client, {
        link.borrow_mut().accepts = 3;
        for polls in 0..120 {
            {
                let mut read = pin!(client.holding_registers::<10>(UNIT, polls));
                for _ in 0..polls {
                    if poll(read.as_mut()).is_ready() {
                        break;
                    }
                    link.borrow_mut().now += 50;
                }
            }
            assert!(!link.borrow().driver, "{polls}");
            let begun = link.borrow().now;
            let read = run(&link, client.holding_registers(UNIT, 300 + polls));
            assert_eq!(read, Ok([value(300 + polls)]), "{polls}");
            assert!(link.borrow().now - begun < 5 * TIMEOUT);
        }
    });
}

#[test]
fn a_future_that_is_forgotten_leaves_the_client_usable() {
    on_each!(link, client, {
        link.borrow_mut().budget = 5;
        let mut write = Box::pin(client.write_single_register(UNIT, 3, 7));
        while link.borrow().sent < 5 {
            assert!(poll(write.as_mut()).is_pending());
            link.borrow_mut().now += 100;
        }
        std::mem::forget(write);
        link.borrow_mut().budget = usize::MAX;
        let read = run(&link, client.holding_registers(UNIT, 107));
        assert_eq!(read, Ok([value(107)]));
    });
}

#[test]
fn a_device_whose_reads_are_cut_by_a_timeout_of_the_program_is_heard_again() {
    for limit in [20_000, 40_000, 80_000, 150_000, 500_000] {
        on_each!(link, client, {
            let mut read = |link: &Link, address: u16| {
                let read = run_for(link, client.holding_registers::<1>(UNIT, address), limit);
                let is_read = matches!(read, Some(Ok(_)));
                assert!(!is_read || read == Some(Ok([value(address)])));
                is_read
            };
            assert!((0..10).all(|at| read(&link, at)));
            link.borrow_mut().is_silent = true;
            assert!(!read(&link, 100));
            link.borrow_mut().is_silent = false;
            let well = link.borrow().now;
            loop {
                let begun = link.borrow().now;
                if read(&link, 105) {
                    break;
                }
                assert!(begun - well < 5 * TIMEOUT, "limit {limit}");
            }
            assert!((0..50).all(|at| read(&link, at)));
        });
    }
}

#[test]
fn unit_0_is_a_broadcast_on_a_line_and_a_unit_on_modbus_tcp() {
    on_lines!(link, client, {
        assert_eq!(run(&link, client.write_single_register(0, 3, 7)), Ok(()));
        let read = run(&link, client.holding_registers::<1>(0, 3));
        assert_eq!(read, Err(Error::BroadcastNotAllowed));
        assert_eq!(link.borrow().requests.len(), 1);
    });
    let link = Net::new(Framing::Tcp, false);
    let mut client = ready!(AsyncClient::tcp(stream(&link)));
    let read = run(&link, client.holding_registers::<1>(0, 3));
    assert_eq!(read, Err(Error::ResponseTimedOut));
    assert_eq!(link.borrow().requests.len(), 1);
    let link = Net::new(Framing::RtuOverTcp, false);
    let mut client = ready!(AsyncClient::rtu_over_tcp(stream(&link)));
    let write = run(&link, client.write_single_register(0, 3, 7));
    assert_eq!(write, Err(Error::BroadcastNotAllowed));
}

#[test]
fn a_request_that_the_standard_does_not_allow_is_refused_and_sends_nothing() {
    on_each!(link, client, {
        let refused = run(&link, client.read_holding_registers(UNIT, 0, &mut []));
        assert_eq!(refused, Err(Error::InvalidQuantity));
        let refused = client.write_multiple_registers(UNIT, 0, &[0; 124]);
        assert_eq!(run(&link, refused), Err(Error::InvalidQuantity));
        let refused = run(&link, client.input_registers::<2>(UNIT, 0xFFFF));
        assert_eq!(refused, Err(Error::InvalidAddress));
        assert_eq!(link.borrow().sent, 0);
    });
}
#[test]
fn the_future_of_a_call_does_not_hold_its_request() {
    let link = Net::new(Framing::Tcp, false);
    let mut client = ready!(AsyncClient::tcp(stream(&link)));
    let future = client.holding_registers::<2>(UNIT, 107);
    let size = std::mem::size_of_val(&future);
    assert!(size < 2 * std::mem::size_of::<Call>(), "{size}");
}
