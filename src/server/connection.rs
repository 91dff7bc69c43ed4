//! Connections that cannot be held: how long one may do nothing. How many there are at once is `places.rs`.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::IncomingStream;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::time::{Instant, Sleep};

use super::places::{Places, Seat, Ticket};

/// How long the head of a request may take from its first byte: a browser sends it at once.
const HEAD_LIMIT: Duration = Duration::from_secs(5);
/// How much of an unwanted body is thrown away after the answer, so that the client gets to read the
/// answer rather than a reset connection.
const LINGER_BYTES: usize = 1 << 20;
/// How long that may take.
const LINGER: Duration = Duration::from_secs(1);

/// A listener that hands out [`Connection`]s.
pub(super) struct Doorkeeper {
    listener: TcpListener,
    places: Arc<Places>,
    idle_limit: Duration,
}

impl Doorkeeper {
    pub(super) fn new(listener: TcpListener, idle_limit: Duration) -> Self {
        let files = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
        Self { listener, places: Places::new(files), idle_limit }
    }
}

impl axum::serve::Listener for Doorkeeper {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        let (stream, address) = axum::serve::Listener::accept(&mut self.listener).await;
        let (seat, dismissed) = self.places.seat(address.ip());
        (Connection::new(stream, self.idle_limit, seat, dismissed), address)
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

impl Connected<IncomingStream<'_, Doorkeeper>> for Ticket {
    fn connect_info(stream: IncomingStream<'_, Doorkeeper>) -> Self {
        stream.io().seat.ticket().clone()
    }
}

/// A connection that ends when nothing could be written to it for the idle limit.
///
/// One rule covers every way of holding a connection. A head or a body that trickles in never gets an
/// answer written; an idle connection has none to write; a client that does not read stops our writing.
/// The event stream writes a comment twice in the limit, so it stays. A head has less time than that, and a connection
/// that must make room for others leaves at once.
pub(super) struct Connection {
    stream: TcpStream,
    idle_limit: Duration,
    deadline: Pin<Box<Sleep>>,
    /// Nothing was read since the last write: the next byte begins a request, which gets the whole limit.
    between_requests: bool,
    /// Bytes thrown away since our side was closed; `None` while it is open.
    lingering: Option<usize>,
    /// When the request began that is being read or answered.
    began: Instant,
    seat: Seat,
    dismissed: oneshot::Receiver<()>,
}

impl Connection {
    fn new(stream: TcpStream, idle_limit: Duration, seat: Seat, dismissed: oneshot::Receiver<()>) -> Self {
        let deadline = Box::pin(tokio::time::sleep(idle_limit));
        let began = Instant::now();
        Self { stream, idle_limit, deadline, between_requests: true, lingering: None, began, seat, dismissed }
    }

    /// Whether this connection must make room; the caller is woken when it must.
    fn is_dismissed(&mut self, context: &mut Context<'_>) -> bool {
        // The sender is kept with the place, so that an end without a word is the same as a word.
        Pin::new(&mut self.dismissed).poll(context).is_ready()
    }

    fn wrote(
        &mut self,
        result: Poll<io::Result<usize>>,
        context: &mut Context<'_>,
    ) -> Poll<io::Result<usize>> {
        match result {
            Poll::Ready(result) => {
                self.between_requests = true;
                self.seat.ticket().wrote();
                self.restart_deadline();
                Poll::Ready(result)
            }
            Poll::Pending => self.wait_for_deadline(context),
        }
    }

    fn restart_deadline(&mut self) {
        self.deadline.as_mut().reset(Instant::now() + self.idle_limit);
    }

    fn wait_for_deadline<T>(&mut self, context: &mut Context<'_>) -> Poll<io::Result<T>> {
        if self.is_dismissed(context) {
            return Poll::Ready(Err(io::ErrorKind::ConnectionAborted.into()));
        }
        ready!(self.deadline.as_mut().poll(context));
        // The head came in time: the rest of the request and its answer have the whole limit.
        let whole = self.began + self.idle_limit;
        if !self.between_requests && self.seat.ticket().is_asking() && Instant::now() < whole {
            self.deadline.as_mut().reset(whole);
            ready!(self.deadline.as_mut().poll(context));
        }
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        match Pin::new(&mut self.stream).poll_read(context, buffer) {
            Poll::Pending => self.wait_for_deadline(context),
            ready @ Poll::Ready(_) => {
                if std::mem::take(&mut self.between_requests) {
                    self.began = Instant::now();
                    let limit = HEAD_LIMIT.min(self.idle_limit);
                    let end = self.began + limit;
                    self.deadline.as_mut().reset(end);
                }
                ready
            }
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.wrote(result, context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.stream).poll_write_vectored(context, slices);
        self.wrote(result, context)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        if self.lingering.is_none() {
            ready!(Pin::new(&mut self.stream).poll_shutdown(context))?;
            self.lingering = Some(0);
            self.deadline.as_mut().reset(Instant::now() + LINGER);
        }
        let mut scrap = [0; 4096];
        loop {
            let mut buffer = ReadBuf::new(&mut scrap);
            let read = Pin::new(&mut self.stream).poll_read(context, &mut buffer);
            let thrown_away = self.lingering.unwrap_or_default();
            match read {
                Poll::Ready(Ok(())) if !buffer.filled().is_empty() && thrown_away < LINGER_BYTES => {
                    self.lingering = Some(thrown_away + buffer.filled().len());
                }
                // Nothing was in the way of the answer: no need to wait for the other side.
                Poll::Pending if thrown_away > 0 => {
                    ready!(self.deadline.as_mut().poll(context));
                    return Poll::Ready(Ok(()));
                }
                _ => return Poll::Ready(Ok(())),
            }
        }
    }
}
