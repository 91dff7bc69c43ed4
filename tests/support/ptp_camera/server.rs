//! On the network: a connection for commands and one for events, each on a thread of its own.

use super::Served;
use super::answer::{Answer, Reply};
use super::body::Body;
use super::wire::{Bytes, packet, receive, send, u16_at, u32_at};
use std::io::{Error, ErrorKind, Read as _, Result};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

/// Bytes of one data packet.
const CHUNK: usize = 1 << 16;
/// How often an idle event connection looks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(200);

/// How one connection is served.
pub type Serve = fn(TcpStream, &Mutex<Body>) -> Result<()>;

/// Takes connections until the camera is switched off.
pub fn serve(listener: &TcpListener, body: &Arc<Mutex<Body>>, connection: Serve) {
    for stream in listener.incoming() {
        let mut locked = body.lock().unwrap();
        if locked.off {
            return;
        }
        if locked.refuses() {
            continue;
        }
        drop(locked);
        let (Ok(stream), body) = (stream, Arc::clone(body)) else { continue };
        // Whoever hangs up is gone: that is all there is to know of an error here.
        std::thread::spawn(move || connection(stream, &body));
    }
}

/// A connection of PTP/IP, for commands or for events.
pub fn connection(mut stream: TcpStream, body: &Mutex<Body>) -> Result<()> {
    stream.set_nodelay(true)?;
    match receive(&mut stream)?.0 {
        packet::EVENT_INIT => events(stream, body),
        packet::COMMAND_INIT => {
            let ack = Bytes::new().u32(1).raw(b"SIMULATED-CAMERA");
            let ack = "camera".encode_utf16().chain([0]).fold(ack, Bytes::u16).u32(0x0001_0000);
            send(&mut stream, packet::COMMAND_ACK, &ack.0)?;
            body.lock().unwrap().sessions += 1;
            commands(stream, body)
        }
        _ => Err(ErrorKind::InvalidData.into()),
    }
}

/// Sends each event once it is due, until another connection takes over.
fn events(mut stream: TcpStream, body: &Mutex<Body>) -> Result<()> {
    let (sender, receiver) = channel();
    let session = body.lock().unwrap().listen(sender);
    send(&mut stream, packet::EVENT_ACK, &[])?;
    loop {
        match receiver.recv_timeout(LOOK) {
            Ok((due, event)) => {
                // Nobody sends to this second channel: its timeout is the time until the event is due.
                let (_keep, never) = channel::<()>();
                let _ = never.recv_timeout(Instant::saturating_duration_since(&due, Instant::now()));
                let event: Bytes = event;
                send(&mut stream, packet::EVENT, &event.0)?;
            }
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
            Err(RecvTimeoutError::Timeout) => {
                let locked = body.lock().unwrap();
                if locked.off || locked.listening() != session {
                    return Ok(());
                }
            }
        }
    }
}

fn commands(mut stream: TcpStream, body: &Mutex<Body>) -> Result<()> {
    loop {
        let (kind, request) = receive(&mut stream)?;
        match kind {
            packet::PING => send(&mut stream, packet::PONG, &[])?,
            packet::REQUEST => {
                let (operation, transaction) = (u16_at(&request, 4), u32_at(&request, 6));
                let parameters: Vec<u32> =
                    (10..request.len()).step_by(4).map(|at| u32_at(&request, at)).collect();
                let data = if u32_at(&request, 0) == 2 { sent_data(&mut stream)? } else { Vec::new() };
                let began = SystemTime::now();
                let answer = body.lock().unwrap().answer(operation, &parameters, &data);
                match answer {
                    Answer::Reply(reply) => {
                        respond(&mut stream, transaction, &reply)?;
                        let served = Served { operation, began, ended: SystemTime::now() };
                        body.lock().unwrap().served.push(served);
                    }
                    Answer::Torn(reply) => {
                        let data = reply.data.unwrap_or_default();
                        let start = Bytes::new().u32(transaction).u64(data.len() as u64);
                        send(&mut stream, packet::START_DATA, &start.0)?;
                        let half = Bytes::new().u32(transaction).raw(&data[..data.len() / 2]);
                        send(&mut stream, packet::DATA, &half.0)?;
                        return Err(Error::from(ErrorKind::BrokenPipe));
                    }
                    // Until the other side loses its patience and hangs up.
                    Answer::Silence => return stream.read(&mut [0]).map(|_| ()),
                    Answer::HangUp => return Err(Error::from(ErrorKind::BrokenPipe)),
                }
            }
            _ => {}
        }
    }
}

fn sent_data(stream: &mut TcpStream) -> Result<Vec<u8>> {
    let mut data = Vec::new();
    loop {
        let (kind, part) = receive(stream)?;
        if matches!(kind, packet::DATA | packet::END_DATA) {
            data.extend(part.get(4..).unwrap_or_default());
        }
        if kind == packet::END_DATA {
            return Ok(data);
        }
    }
}

fn respond(stream: &mut TcpStream, transaction: u32, reply: &Reply) -> Result<()> {
    if let Some(data) = &reply.data {
        let start = Bytes::new().u32(transaction).u64(data.len() as u64);
        send(stream, packet::START_DATA, &start.0)?;
        let mut chunks = data.chunks(CHUNK).peekable();
        if chunks.peek().is_none() {
            send(stream, packet::END_DATA, &Bytes::new().u32(transaction).0)?;
        }
        while let Some(chunk) = chunks.next() {
            let kind = if chunks.peek().is_some() { packet::DATA } else { packet::END_DATA };
            send(stream, kind, &Bytes::new().u32(transaction).raw(chunk).0)?;
        }
    }
    let response = Bytes::new().u16(reply.code).u32(transaction).all32(&reply.parameters);
    send(stream, packet::RESPONSE, &response.0)
}
