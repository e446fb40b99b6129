//! The server under attack: whatever comes in, it refuses it with a reason, keeps its memory within
//! bounds, and serves those who behave as if nothing had happened.

use std::io::{Read, Write};
use std::time::{Duration, Instant};

use crate::common::{NAME, quick};
use selvedge_live::MOST_PAGES;
use tungstenite::Message;

#[test]
fn what_is_no_message_is_refused_with_a_reason() {
    let served = quick();
    let mut friend = served.page();
    let mut page = served.page();
    let unknown = Message::Binary(vec![3, 77, 0, 0].into());
    page.socket.send(unknown).unwrap();
    let (code, text) = page.closed();
    assert_eq!(code, 1002, "{text}");
    assert!(text.contains("kind 77"), "{text}");
    let mut page = served.page();
    page.socket.send(Message::Text("hello".into())).unwrap();
    assert_eq!(page.closed().0, 1003);
    // Longer than any message: the connection is cut while it is being sent, or after.
    let mut page = served.page();
    let _ = page.socket.send(Message::Binary(vec![0; 1 << 20].into()));
    assert_ne!(page.closed().0, 1000);
    let first = friend.frame(|_| true).number;
    friend.frame(|frame| frame.number > first + 10);
    served.close();
}

#[test]
fn what_cannot_be_done_is_told_and_nothing_ends() {
    let served = quick();
    let mut page = served.page();
    page.frame(|_| true);
    let no_scene =
        r#"{"do":"order","order":{"scene":"none","mesh":null,"material":null,"model":""}}"#;
    for (command, said) in [
        (r#"{"do":"hold","vertices":[4]}"#, "vertex 4"),
        (r#"{"do":"motion","name":"backflip"}"#, "backflip"),
        (r#"{"do":"wind","wind":[1e30,0,0]}"#, "at most 30"),
        (r#"{"do":"rate","rate":1e9}"#, "1000000000"),
        (r#"{"do":"replay"}"#, "nothing has been recorded"),
        (no_scene, "none"),
    ] {
        page.command(command);
        page.state(|state| {
            let text = state["notice"]["text"].as_str();
            text.is_some_and(|text| text.contains(said))
        });
    }
    page.command(r#"{"do":"limits","speed":-1e300,"acceleration":1e300}"#);
    page.state(|s| s["limits"]["speed"] == 0.05 && s["limits"]["acceleration"] == 100.0);
    let number = page.frame(|_| true).number;
    page.frame(|frame| frame.number > number);
    served.close();
}

#[test]
fn a_flood_is_cut_off_and_others_hardly_notice() {
    let served = quick();
    let mut friend = served.page();
    let before = friend.frame(|_| true).number;
    let memory = resident();
    for _ in 0..4 {
        let mut page = served.page();
        let mut body = Vec::new();
        for word in [1_u32, 1, 0, 0, 0, 0] {
            body.extend(word.to_le_bytes());
        }
        let bytes = [&[3, 17, 0, 0][..], &body].concat();
        let started = Instant::now();
        // 10,000 at once, far more than so many in a second.
        let mut send = || page.socket.send(Message::Binary(bytes.clone().into()));
        let sent = (0..10_000).take_while(|_| send().is_ok()).count();
        let (code, reason) = page.closed();
        assert!(code == 1008 || code == 0, "{code} {reason}");
        assert!(sent < 10_000 || started.elapsed() < Duration::from_secs(10));
    }
    friend.frame(|frame| frame.number > before + 20);
    assert_bounded(memory);
    served.close();
}

#[test]
fn who_does_not_read_holds_nobody_up() {
    let served = quick();
    let memory = resident();
    let silent: Vec<_> = (0..8).map(|_| served.page()).collect();
    let mut friend = served.page();
    let first = friend.frame(|_| true).number;
    let started = Instant::now();
    let last = friend.frame(|frame| frame.number >= first + 60).number;
    // A second of frames takes about a second, however many do not read.
    let took = started.elapsed();
    assert!(took < Duration::from_secs(8), "{took:?}");
    // Those who say nothing get three frames and no more, whatever happens meanwhile.
    for mut page in silent.into_iter().take(2) {
        let mut is_frame = || match page.socket.read().unwrap() {
            Message::Binary(bytes) => bytes[1] == 4,
            other => panic!("{other}"),
        };
        let mut frames = 0;
        while frames < 3 {
            frames += usize::from(is_frame());
        }
        // States come all the time: after these, every frame that was sent has been read.
        frames += (0..20).filter(|_| is_frame()).count();
        assert_eq!(frames, 3, "of {}", last - first);
    }
    assert_bounded(memory);
    served.close();
}

#[test]
fn two_hundred_sockets_are_too_many_and_come_in_when_there_is_room() {
    let served = quick();
    let memory = resident();
    let mut pages = Vec::new();
    let mut refused = 0;
    for _ in 0..200 {
        match tungstenite::client(served.request(), served.connect()) {
            Ok((socket, _)) => pages.push(crate::common::Page { socket }),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
                assert_eq!(response.status().as_u16(), 503);
                refused += 1;
            }
            Err(error) => panic!("{error}"),
        }
    }
    assert_eq!((pages.len(), refused), (MOST_PAGES, 200 - MOST_PAGES));
    pages[0].state(|state| state["viewers"] == MOST_PAGES);
    drop(pages);
    // The server hears of it within a moment.
    let until = Instant::now() + Duration::from_secs(20);
    while served.status(|_| ()) != 101 {
        assert!(Instant::now() < until);
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_bounded(memory);
    served.close();
}

#[test]
fn many_silent_connections_do_not_delay_a_page() {
    let served = quick();
    let silent: Vec<_> = (0..400).map(|_| served.connect()).collect();
    let started = Instant::now();
    let mut page = served.page();
    page.frame(|_| true);
    // A busy machine takes its time.
    let took = started.elapsed();
    assert!(took < Duration::from_secs(3), "{took:?}");
    drop(silent);
    served.close();
}

#[test]
fn foreign_pages_and_names_are_turned_away() {
    let served = quick();
    let own = served.server.address().to_string();
    let status = |host: &str, origin: Option<&str>| {
        served.status(|request| {
            let headers = request.headers_mut();
            headers.insert("Host", host.parse().unwrap());
            if let Some(origin) = origin {
                headers.insert("Origin", origin.parse().unwrap());
            }
        })
    };
    let hosts = [
        "localhost:7878",
        "[::1]:7878",
        "192.168.1.7:80",
        "LocalHost",
    ];
    for host in hosts.into_iter().chain([own.as_str()]) {
        let origin = format!("http://{host}");
        assert_eq!(status(host, Some(&origin)), 101, "{host}");
        assert_eq!(status(host, None), 101, "{host}");
    }
    let named = format!("{NAME}:7878");
    assert_eq!(status(&named, Some(&format!("https://{named}"))), 101);
    for origin in [
        "http://evil.example",
        "http://localhost:1",
        &format!("http://{own}.evil.example"),
        "null",
        "",
        "file://",
        &own,
    ] {
        assert_eq!(status(&own, Some(origin)), 403, "{origin}");
    }
    // A name that another site has point here.
    let evil = "evil.example:7878";
    assert_eq!(status(evil, Some(&format!("http://{evil}"))), 403);
    assert_eq!(status(evil, None), 403);
    let old = served.status(|request| {
        let protocol = "selvedge.v1".parse().unwrap();
        request
            .headers_mut()
            .insert("Sec-WebSocket-Protocol", protocol);
    });
    assert_eq!(old, 400);
    served.close();
}

#[test]
fn nothing_but_the_page_is_served() {
    let served = quick();
    let ask_of = |hosts: &str, line: &str| {
        let mut stream = served.connect();
        let request = format!("{line} HTTP/1.1\r\n{hosts}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    };
    let ask = |line: &str| ask_of("Host: localhost\r\n", line);
    let page = ask("GET /");
    assert!(page.starts_with("HTTP/1.1 200"), "{page}");
    let policy = "content-security-policy: default-src 'self'";
    assert!(page.to_lowercase().contains(policy), "{page}");
    for path in [
        "/../Cargo.toml",
        "/../../../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/..%2f..%2fetc%2fpasswd",
        "/viewer.js/../../Cargo.toml",
        "/.git/config",
        "//etc/passwd",
        "/viewer.js%00.html",
        "/sources.txt",
    ] {
        let answer = ask(&format!("GET {path}"));
        assert!(answer.starts_with("HTTP/1.1 4"), "{path}: {answer}");
        let is_file = answer.contains("root:") || answer.contains("[package]");
        assert!(!is_file, "{path}");
    }
    for hosts in ["", "Host: \r\n", &"Host: localhost\r\n".repeat(2)] {
        let answer = ask_of(hosts, "GET /");
        assert!(answer.starts_with("HTTP/1.1 4"), "{hosts:?}: {answer}");
    }
    assert!(ask("POST /").starts_with("HTTP/1.1 405"));
    assert!(ask("GET /socket").starts_with("HTTP/1.1 4"));
    served.close();
}

/// Memory of this process that is in use `[bytes]`, where the system tells.
fn resident() -> Option<usize> {
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: usize = pages.split_whitespace().nth(1)?.parse().ok()?;
    Some(pages * 4096)
}

/// The tests of this file run beside each other in one process: what all of them hold at once,
/// buffers of some hundred sockets on both sides, stays far below this. A queue that grew with
/// 40,000 messages or with unread frames would not.
fn assert_bounded(before: Option<usize>) {
    if let (Some(before), Some(now)) = (before, resident()) {
        let grown = now.saturating_sub(before);
        assert!(grown < 96 << 20, "memory grew by {} MB", grown >> 20);
    }
}
