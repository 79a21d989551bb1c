//! Connections to devices on a network.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// A connection to `host:port`, of which a read may take so long; else what is wrong.
pub(crate) fn connected(address: &str, timeout: Duration, read: Duration) -> Result<TcpStream, String> {
    let mut last = "the name has no address".to_owned();
    if let Some((_, port)) = address.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_err()) {
        return Err(format!("found port {port:?}, expected 1 to 65535"));
    }
    for target in address.to_socket_addrs().map_err(|error| error.to_string())? {
        match TcpStream::connect_timeout(&target, timeout) {
            Ok(stream) => {
                let prepared = stream.set_nodelay(true).and_then(|()| stream.set_read_timeout(Some(read)));
                return prepared.map(|()| stream).map_err(|error| error.to_string());
            }
            Err(error) => last = error.to_string(),
        }
    }
    Err(last)
}
