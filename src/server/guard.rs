//! Who may come in: the checks every request passes before a route sees it.
//!
//! The browser is the danger: any page a person visits can send requests to `127.0.0.1`. A page's own
//! name made to point here (DNS rebinding) shows in `Host`; a form or script of another site shows in
//! `Origin`; and the content type of a JSON body cannot be had by a form at all.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use axum::extract::{ConnectInfo, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Redirect, Response};
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;

use super::error::ServerError;
use super::files::FILE_LIMIT_BYTES;
use super::guesses::Guesses;
use super::places::Ticket;
use super::routes::BODY_LIMIT_BYTES;

/// Characters a token has at least: 64 bits, where they are hexadecimal.
pub const MIN_TOKEN_LENGTH: usize = 16;
/// The cookie that stands for the token once the page was opened with it.
pub(super) const COOKIE: &str = "grainrig_token";
/// What the page and the API may load: their own, and nothing runs that is not a file of ours.
const PAGE_POLICY: &str =
    "default-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'; object-src 'none'";

/// Says whether a daemon may listen on `address` with this token, or without one.
///
/// # Errors
/// [`ServerError::OpenToAll`] off loopback without a token; [`ServerError::WeakToken`] for a token that
/// is short or does not fit in an address.
pub fn check_bind(address: SocketAddr, token: Option<&str>) -> Result<(), ServerError> {
    match token {
        None if address.ip().to_canonical().is_loopback() => Ok(()),
        None => Err(ServerError::OpenToAll { address }),
        Some(token) => {
            let length = token.chars().count();
            let fits = |c: char| c.is_ascii_alphanumeric() || "-._~".contains(c);
            let unfit = token.chars().filter(|c| !fits(*c)).count();
            if length < MIN_TOKEN_LENGTH || unfit > 0 {
                return Err(ServerError::WeakToken { length, unfit });
            }
            Ok(())
        }
    }
}

/// The rules for one listener.
#[derive(Debug)]
pub(super) struct Guard {
    token: Option<Token>,
    allowed_hosts: Vec<String>,
    /// Listening off loopback: any literal address is a right `Host`, since only a name can be rebound.
    any_address: bool,
    guesses: Guesses,
}

/// Digests of the token, so that comparing takes as long for any guess of any length.
#[derive(Debug)]
struct Token {
    digest: [u8; 32],
    cookie: String,
}

impl Guard {
    pub(super) fn new(address: SocketAddr, token: Option<&str>, allowed_hosts: &[String]) -> Self {
        let token = token.map(|token| Token {
            digest: Sha256::digest(token).into(),
            cookie: crate::session::sha256_hex(format!("grainrig cookie {token}").as_bytes()),
        });
        let allowed_hosts = allowed_hosts.iter().map(|host| host.to_ascii_lowercase()).collect();
        let any_address = !address.ip().to_canonical().is_loopback();
        Self { token, allowed_hosts, any_address, guesses: Guesses::default() }
    }

    /// The host the request is for, if it is us.
    fn check_host(&self, uri: &Uri, headers: &HeaderMap) -> Result<String, ServerError> {
        let mut hosts = headers.get_all(header::HOST).iter();
        let (first, second) = (hosts.next(), hosts.next());
        let host = match (first, second) {
            (Some(host), None) => host.to_str().unwrap_or_default(),
            _ => "",
        };
        let foreign = || ServerError::ForeignHost { host: shortened(host) };
        // A request to a proxy names the host in its first line as well.
        if uri.authority().is_some_and(|authority| !authority.as_str().eq_ignore_ascii_case(host)) {
            return Err(foreign());
        }
        let host = host.to_ascii_lowercase();
        if self.is_ours(without_port(&host)) { Ok(host) } else { Err(foreign()) }
    }

    fn is_ours(&self, name: &str) -> bool {
        if name == "localhost" || self.allowed_hosts.iter().any(|host| host == name) {
            return true;
        }
        let bracketed = name.strip_prefix('[').and_then(|name| name.strip_suffix(']'));
        let ip = match bracketed {
            Some(name) => name.parse::<Ipv6Addr>().map(IpAddr::V6),
            None => name.parse::<Ipv4Addr>().map(IpAddr::V4),
        };
        ip.is_ok_and(|ip| self.any_address || ip.to_canonical().is_loopback())
    }

    /// A page of ours sends no `Origin`, or one with the host it was opened at. Behind a proxy that is
    /// the proxy's name, which must be allowed.
    fn check_origin(&self, host: &str, headers: &HeaderMap) -> Result<(), ServerError> {
        for origin in headers.get_all(header::ORIGIN) {
            let origin = origin.to_str().unwrap_or_default().to_ascii_lowercase();
            let authority = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
            let ours = authority.is_some_and(|authority| {
                authority == host
                    || self.allowed_hosts.iter().any(|allowed| allowed == without_port(authority))
            });
            if !ours {
                return Err(ServerError::ForeignOrigin { origin: shortened(&origin) });
            }
        }
        Ok(())
    }

    /// The token as a header, as the page's cookie, or, where a picture or an event stream is read
    /// (which cannot send headers), in the query.
    fn check_token(&self, request: &Request) -> Result<(), ServerError> {
        let Some(token) = &self.token else { return Ok(()) };
        let headers = request.headers();
        let bearer = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
        let bearer = bearer.and_then(|value| value.strip_prefix("Bearer "));
        let in_query = query_token(request.uri()).filter(|_| request.method() == Method::GET);
        let by_token = bearer.or(in_query).is_some_and(|guess| token.is(guess));
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let by_cookie = cookies
            .flat_map(|cookies| cookies.split(';'))
            .filter_map(|cookie| cookie.trim().split_once('='))
            .any(|(name, value)| {
                name == COOKIE && bool::from(value.as_bytes().ct_eq(token.cookie.as_bytes()))
            });
        if by_token || by_cookie { Ok(()) } else { Err(ServerError::Unauthorised) }
    }
}

impl Guard {
    /// As [`Self::check_token`]; wrong tokens use up what an address may try. From then on it is told to wait before its
    /// token is looked at, except on a connection that showed the right one, and except on loopback, where one address is
    /// everybody's and a neighbour's guesses must not keep the operator out: there only wrong tokens are told to wait.
    fn check_guess(&self, ticket: &Ticket, request: &Request) -> Result<(), ServerError> {
        let (bearer, headers) = (header::AUTHORIZATION, request.headers());
        let guesses = headers.contains_key(bearer)
            || headers.get_all(header::COOKIE).iter().any(|c| c.to_str().is_ok_and(|c| c.contains(COOKIE)))
            || query_token(request.uri()).is_some();
        if self.token.is_none() || !guesses {
            return self.check_token(request);
        }
        let too_many = |seconds| ServerError::TooManyGuesses { seconds };
        if !ticket.address().is_loopback()
            && !ticket.is_known()
            && let Some(seconds) = self.guesses.are_spent(ticket)
        {
            return Err(too_many(seconds));
        }
        match self.check_token(request) {
            Ok(()) => Ok(()),
            Err(wrong) => Err(self.guesses.spend(ticket).map_or(wrong, too_many)),
        }
    }
}

impl Token {
    fn is(&self, guess: &str) -> bool {
        Sha256::digest(guess).as_slice().ct_eq(&self.digest).into()
    }
}

/// The middleware: lets a request through to the routes, or answers it.
pub(super) async fn guard(
    State(app): State<super::routes::App>,
    ConnectInfo(ticket): ConnectInfo<Ticket>,
    request: Request,
    next: Next,
) -> Response {
    ticket.asks();
    let page = !request.uri().path().starts_with("/api/");
    let mut response = match admit(&app.guard, &ticket, &request, page) {
        Ok(None) => {
            let response = next.run(request).await;
            if response.status().is_success() {
                ticket.was_answered(!page && app.guard.token.is_some());
            }
            response
        }
        Ok(Some(answer)) => answer,
        Err(error) => error.into_response(),
    };
    let headers = response.headers_mut();
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(PAGE_POLICY));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert("cross-origin-resource-policy", HeaderValue::from_static("same-origin"));
    let caching = if page { "no-cache" } else { "no-store" };
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static(caching));
    response
}

/// Lets the request in (`None`), or answers it without any route.
fn admit(
    guard: &Guard,
    ticket: &Ticket,
    request: &Request,
    page: bool,
) -> Result<Option<Response>, ServerError> {
    let headers = request.headers();
    let host = guard.check_host(request.uri(), headers)?;
    guard.check_origin(&host, headers)?;
    if page {
        // A token in the page's address is a guess like others.
        let guesses = guard.token.is_some() && query_token(request.uri()).is_some();
        if guesses && guard.guesses.are_spent(ticket).is_some() && !ticket.address().is_loopback() {
            return Ok(None);
        }
        let admitted = guard.admit_by_link(request);
        if guesses && admitted.is_none() {
            // The page holds no secret and is shown; that it was opened with a wrong token counts.
            let _ = guard.guesses.spend(ticket);
        }
        return Ok(admitted);
    }
    guard.check_guess(ticket, request)?;
    let length = headers.get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok());
    let length = length.map_or(Some(0), |length| length.parse::<usize>().ok());
    // A file has any type: no form can put one, and another site's script must ask first.
    let is_file = request.method() == Method::PUT;
    if is_file && length.is_some_and(|length| length > FILE_LIMIT_BYTES) {
        return Err(ServerError::FileTooLarge);
    }
    if !is_file && length.is_none_or(|length| length > BODY_LIMIT_BYTES) {
        return Err(ServerError::TooLarge);
    }
    let has_body = length != Some(0) || headers.contains_key(header::TRANSFER_ENCODING);
    if has_body && !is_file && !request.method().is_safe() && !is_json(headers) {
        return Err(ServerError::NotJson);
    }
    Ok(None)
}

impl Guard {
    /// The page holds no secret, so anyone may have it. Opened with the right token in its address it
    /// gets a cookie, and an address without the token, which would otherwise stay in the history.
    fn admit_by_link(&self, request: &Request) -> Option<Response> {
        let token = self.token.as_ref()?;
        let guess = query_token(request.uri())?;
        if request.uri().path() != "/" || !token.is(guess) {
            return None;
        }
        let cookie = format!("{COOKIE}={}; Path=/; HttpOnly; SameSite=Strict", token.cookie);
        Some(([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response())
    }
}

/// The `token` in the query; none of the characters a token may have is ever percent-encoded.
fn query_token(uri: &Uri) -> Option<&str> {
    uri.query()?.split('&').find_map(|pair| pair.strip_prefix("token="))
}

fn is_json(headers: &HeaderMap) -> bool {
    let media_type =
        headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let media_type = media_type.split(';').next().unwrap_or_default();
    media_type.trim().eq_ignore_ascii_case("application/json")
}

/// `[::1]:80` → `[::1]`, `localhost:80` → `localhost`.
fn without_port(authority: &str) -> &str {
    match authority.rsplit_once(':') {
        Some((host, port)) if port.bytes().all(|b| b.is_ascii_digit()) => host,
        _ => authority,
    }
}

/// The beginning of what a client sent, for a message.
pub(super) fn shortened(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(80).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn host(guard: &Guard, host: &str) -> bool {
        let headers = HeaderMap::from_iter([(header::HOST, HeaderValue::from_str(host).unwrap())]);
        guard.check_host(&Uri::from_static("/"), &headers).is_ok()
    }

    #[test]
    fn only_names_that_cannot_be_rebound_are_ours() {
        let local = Guard::new("127.0.0.1:80".parse().unwrap(), None, &["Lab.example".into()]);
        for ours in ["localhost", "localhost:80", "127.0.0.1:80", "127.8.8.8", "[::1]:80", "LAB.example:9"] {
            assert!(host(&local, ours), "{ours}");
        }
        let foreign = [
            "evil.example",
            "",
            "192.168.1.5",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "::1:",
            "::1",
        ];
        for foreign in foreign {
            assert!(!host(&local, foreign), "{foreign}");
        }
        let open = Guard::new("0.0.0.0:80".parse().unwrap(), Some("x"), &[]);
        assert!(host(&open, "192.168.1.5:80") && host(&open, "[fe80::1]"));
        assert!(!host(&open, "evil.example"));
    }

    #[test]
    fn two_hosts_and_another_host_in_the_first_line_are_foreign() {
        let guard = Guard::new("127.0.0.1:80".parse().unwrap(), None, &[]);
        let mut headers = HeaderMap::from_iter([(header::HOST, HeaderValue::from_static("localhost"))]);
        assert!(guard.check_host(&Uri::from_static("http://evil.example/"), &headers).is_err());
        headers.append(header::HOST, HeaderValue::from_static("localhost"));
        assert!(guard.check_host(&Uri::from_static("/"), &headers).is_err());
    }

    #[test]
    fn listening_to_the_network_needs_a_good_token() {
        fn check(address: &str, token: Option<&str>) -> Result<(), ServerError> {
            check_bind(address.parse().unwrap(), token)
        }
        assert!(check("127.0.0.1:1", None).is_ok() && check("[::1]:1", None).is_ok());
        let error = check("0.0.0.0:8080", None).unwrap_err().to_string();
        assert!(error.contains("0.0.0.0:8080") && error.contains("token of at least 16"), "{error}");
        assert!(check("[::]:1", None).is_err() && check("192.168.1.5:1", None).is_err());
        assert!(check("0.0.0.0:1", Some("0123456789abcdef")).is_ok());
        assert!(check("127.0.0.1:1", Some("short")).is_err());
        for unfit in [" ", "&", "%", "ä", "\n"] {
            assert!(check("0.0.0.0:1", Some(&format!("0123456789abcdef{unfit}"))).is_err(), "{unfit:?}");
        }
    }
}
