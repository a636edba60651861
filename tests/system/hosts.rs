//! Hosts of one network: they meet, their clocks differ, and the network is as bad as asked.

use rustix::process::{Pid, Signal, kill_process};
use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddrV4, TcpListener, TcpStream, UdpSocket};
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};
use tests::hosts::weather::Weather;
use tests::hosts::{Host, Hosts, Network, Plan, available, clock_ahead_ns};

const PORT: u16 = 4000;
const LEFT: Plan = Plan { name: "left", clock_ahead_s: Some(5000) };
const RIGHT: Plan = Plan { name: "right", clock_ahead_s: Some(70_000) };
const FUSION: Plan = Plan { name: "fusion", clock_ahead_s: None };

/// Hosts, unless this machine has none: then the reason is printed and the test is over.
fn made(network: Network) -> Option<Hosts> {
    if let Err(why) = available() {
        println!("skipped: {why}");
        return None;
    }
    Some(Hosts::new(&[LEFT, RIGHT, FUSION], network, 1).unwrap())
}

/// A datagram that arrived: its number and how long it took.
#[derive(Debug, Clone, Copy)]
struct Arrival {
    idx: u32,
    took: Duration,
    at: Instant,
}

fn socket_on(host: &Host, port: u16) -> UdpSocket {
    let socket = host.inside(|| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port))).unwrap().unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    socket
}

/// Whether one host hears another: the first datagram asks for the hardware address, so a few are
/// sent.
fn hears(sender: &UdpSocket, receiver: &UdpSocket) -> bool {
    (0..3).any(|_| {
        sender.send(&[]).unwrap();
        receiver.recv(&mut [0; 8]).is_ok()
    })
}

fn is_heard(from: &Host, to: &Host) -> bool {
    let (sender, receiver) = (socket_on(from, 0), socket_on(to, PORT));
    sender.connect((to.address, PORT)).unwrap();
    hears(&sender, &receiver)
}

/// `n` datagrams of `n_bytes`, one `every`; what arrived, in the order it did.
fn arrivals((from, to): (&Host, &Host), n: u32, every: Duration, n_bytes: usize) -> Vec<Arrival> {
    let (sender, receiver) = (socket_on(from, 0), socket_on(to, PORT));
    sender.connect((to.address, PORT)).unwrap();
    assert!((0..20).any(|_| hears(&sender, &receiver)), "{} and {}", from.name, to.name);
    let begun = Instant::now();
    std::thread::scope(|scope| {
        let receiving = scope.spawn(|| {
            let (mut arrived, mut bytes) = (Vec::new(), [0; 2048]);
            while let Ok(n_bytes) = receiver.recv(&mut bytes) {
                let at = Instant::now();
                if n_bytes < 12 {
                    continue; // a late answer to the question above
                }
                let idx = u32::from_le_bytes(bytes[..4].try_into().unwrap());
                let sent_ns = u64::from_le_bytes(bytes[4..12].try_into().unwrap());
                arrived.push(Arrival {
                    idx,
                    took: (at - begun) - Duration::from_nanos(sent_ns),
                    at,
                });
            }
            arrived
        });
        let mut bytes = vec![0; n_bytes];
        for idx in 0..n {
            let due = every * idx;
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
            bytes[..4].copy_from_slice(&idx.to_le_bytes());
            let sent_ns = u64::try_from(begun.elapsed().as_nanos()).unwrap();
            bytes[4..12].copy_from_slice(&sent_ns.to_le_bytes());
            sender.send(&bytes).unwrap();
        }
        receiving.join().unwrap()
    })
}

fn quantile(arrived: &[Arrival], share: f64) -> Duration {
    let mut took: Vec<Duration> = arrived.iter().map(|arrival| arrival.took).collect();
    took.sort_unstable();
    took[((took.len() - 1) as f64 * share).round() as usize]
}

#[test]
fn a_clean_network_and_fair_air_lose_nothing_and_keep_the_order() {
    for network in [Network::Clean, Network::Air(Weather::FAIR)] {
        let Some(hosts) = made(network) else { return };
        let ends = (hosts.host("left").unwrap(), hosts.host("fusion").unwrap());
        let arrived = arrivals(ends, 500, Duration::from_millis(2), 300);
        let idxs: Vec<u32> = arrived.iter().map(|arrival| arrival.idx).collect();
        assert_eq!(idxs, (0..500).collect::<Vec<u32>>());
        let [p50, p99] = [0.5, 0.99].map(|share| quantile(&arrived, share));
        println!("{}: one way {p50:?} (median), {p99:?} (p99)", hosts.joined_by());
    }
}

#[test]
fn weather_is_as_asked() {
    let Some(hosts) = made(Network::Weather(Weather::WIFI)) else { return };
    let ends = (hosts.host("right").unwrap(), hosts.host("fusion").unwrap());
    let arrived = arrivals(ends, 3000, Duration::from_millis(1), 300);
    let lost = 1.0 - arrived.len() as f64 / 3000.0;
    let n_passed = arrived.windows(2).filter(|pair| pair[1].idx < pair[0].idx).count();
    let quantiles = [0.0, 0.1, 0.5, 0.9, 0.99, 1.0].map(|share| quantile(&arrived, share));
    println!("{}: {:.1} % lost, {n_passed} passed", hosts.joined_by(), lost * 100.0);
    println!("held for {quantiles:?} (least, p10, p50, p90, p99, most), asked 5 ms ± 3 ms");
    // Three sigma of 3000 draws of 2 %.
    assert!((lost - 0.02).abs() < 0.0077, "{lost}");
    assert!(n_passed > 100, "{n_passed} passed");
    assert!(quantiles[0] >= Duration::from_millis(2), "{quantiles:?}");
    assert!(quantiles[3] - quantiles[1] >= Duration::from_millis(4), "{quantiles:?}");
}

#[test]
fn a_line_of_20_mbit_s_is_not_faster() {
    let weather = Weather { rate_bit_s: Some(20_000_000), ..Weather::FAIR };
    let Some(hosts) = made(Network::Weather(weather)) else { return };
    let ends = (hosts.host("left").unwrap(), hosts.host("fusion").unwrap());
    let arrived = arrivals(ends, 200, Duration::ZERO, 1000);
    assert_eq!(arrived.len(), 200);
    // 1042 bytes with the heads of UDP, IP and Ethernet.
    let took = arrived[199].at - arrived[0].at;
    let mbit_s = 199.0 * 1042.0 * 8.0 / took.as_secs_f64() / 1e6;
    println!("{}: {mbit_s:.2} Mbit/s in a burst, asked 20", hosts.joined_by());
    assert!(mbit_s < 20.5, "{mbit_s}");
}

#[test]
fn a_host_that_is_cut_off_hears_nothing_until_its_link_is_mended() {
    for network in [Network::Clean, Network::Air(Weather::FAIR)] {
        let Some(hosts) = made(network) else { return };
        let [left, right, fusion] =
            ["left", "right", "fusion"].map(|name| hosts.host(name).unwrap());
        let joined_by = hosts.joined_by();
        assert!(is_heard(left, fusion), "{joined_by}");
        hosts.cut("left").unwrap();
        assert!(!is_heard(left, fusion), "{joined_by}");
        assert!(!is_heard(fusion, left), "{joined_by}");
        assert!(is_heard(right, fusion), "{joined_by}");
        hosts.mend("left").unwrap();
        assert!((0..20).any(|_| is_heard(left, fusion)), "{joined_by}");
    }
}

#[test]
fn a_group_is_heard_by_all() {
    let group = Ipv4Addr::new(224, 0, 0, 224);
    for network in [Network::Clean, Network::Air(Weather::FAIR)] {
        let Some(hosts) = made(network) else { return };
        let [left, right, fusion] =
            ["left", "right", "fusion"].map(|name| hosts.host(name).unwrap());
        let listeners = [left, right].map(|host| {
            let socket = socket_on(host, PORT);
            socket.join_multicast_v4(&group, &host.address).unwrap();
            socket
        });
        socket_on(fusion, 0).send_to(b"who is there?", (group, PORT)).unwrap();
        for listener in listeners {
            let (n_bytes, from) = listener.recv_from(&mut [0; 32]).unwrap();
            assert_eq!((n_bytes, from.ip()), (13, fusion.address.into()));
        }
    }
}

#[test]
fn a_tcp_stream_stands_the_weather() {
    let Some(hosts) = made(Network::Weather(Weather::WIFI)) else { return };
    let [left, fusion] = ["left", "fusion"].map(|name| hosts.host(name).unwrap());
    let at = SocketAddrV4::new(fusion.address, PORT);
    let listener = fusion.inside(|| TcpListener::bind(at)).unwrap().unwrap();
    let sent: Vec<u8> = (0..400_000_u32).map(|i| (i * 7 / 3) as u8).collect();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut stream = left.inside(|| TcpStream::connect(at)).unwrap().unwrap();
            stream.write_all(&sent).unwrap();
        });
        let (mut stream, begun) = (listener.accept().unwrap().0, Instant::now());
        let mut heard = Vec::new();
        stream.read_to_end(&mut heard).unwrap();
        assert!(heard == sent, "{} of {} bytes", heard.len(), sent.len());
        println!("{}: 400 kB by TCP in {:.2?}", hosts.joined_by(), begun.elapsed());
    });
}

#[test]
fn a_process_on_a_host_is_the_binary_and_has_the_clock_of_the_host() {
    let Some(hosts) = made(Network::Clean) else { return };
    for host in hosts.all() {
        let uptime_s = || -> f64 {
            let text = std::fs::read_to_string("/proc/uptime").unwrap();
            text.split(' ').next().unwrap().parse().unwrap()
        };
        // `sleep` writes nothing and `cat` waits for its input: both can be looked at in peace.
        let mut command = host.command(Path::new("cat"));
        let command = command.args(["/proc/uptime", "-"]).stdin(Stdio::piped());
        let before_s = uptime_s();
        let mut cat = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut bytes = [0; 64];
        let n_bytes = cat.stdout.as_mut().unwrap().read(&mut bytes).unwrap();
        let after_s = uptime_s();
        let theirs = String::from_utf8_lossy(&bytes[..n_bytes]).into_owned();
        let theirs_s: f64 = theirs.split(' ').next().unwrap().parse().unwrap();
        let ahead_s = host.clock_ahead_ns() as f64 / 1e9;
        // /proc/uptime is cut to a hundredth.
        let (least_s, most_s) = (before_s + ahead_s - 0.011, after_s + ahead_s + 0.011);
        assert!((least_s..=most_s).contains(&theirs_s), "{theirs_s}: {least_s} to {most_s}");
        assert_eq!(clock_ahead_ns(cat.id()).unwrap(), host.clock_ahead_ns());
        assert_eq!(std::fs::read_to_string(format!("/proc/{}/comm", cat.id())).unwrap(), "cat\n");
        kill_process(Pid::from_child(&cat), Signal::TERM).unwrap();
        use std::os::unix::process::ExitStatusExt as _;
        assert_eq!(cat.wait().unwrap().signal(), Some(15));
    }
}

#[test]
fn hosts_leave_nothing_and_clean_up_after_the_killed() {
    let Some(first) = made(Network::Air(Weather::FAIR)) else { return };
    let stale = "/run/netns/tennis-4194305-0-left"; // no process has a number above 4194304
    let add = ["netns", "add", "tennis-4194305-0-left"];
    assert!(std::process::Command::new("ip").args(add).status().unwrap().success());
    let second = made(Network::Clean).unwrap();
    assert!(!Path::new(stale).exists());
    let ours: Vec<_> = first.namespaces().iter().chain(second.namespaces()).cloned().collect();
    assert_eq!(ours.len(), 7);
    let is_there = |name: &String| Path::new("/run/netns").join(name).exists();
    assert!(ours.iter().all(is_there));
    drop((first, second));
    assert!(!ours.iter().any(is_there));
}
