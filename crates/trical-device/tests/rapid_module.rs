//! The RAPID module and the protocol module must not drift apart; no RAPID compiler is at hand, so what can be checked
//! of its form is checked here.

use trical_device::controller::rapid_protocol::{self as protocol, code};

fn module() -> String {
    read("TriCal.mod")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(format!("{}/../../rapid/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

/// Both modules: the one of the socket and the one of the Web Services.
fn modules() -> [String; 2] {
    [module(), read("TriCalRws.mod")]
}

fn statements() -> Vec<String> {
    statements_of(&module())
}

/// Lines without comments and the inside of strings.
fn statements_of(module: &str) -> Vec<String> {
    module
        .lines()
        .map(|line| {
            let mut inside = false;
            let mut kept = String::new();
            for letter in line.chars() {
                match letter {
                    '"' => inside = !inside,
                    '!' if !inside => break,
                    _ if inside => {}
                    _ => kept.push(letter),
                }
            }
            assert!(!inside, "string without end: {line}");
            kept.trim().to_owned()
        })
        .collect()
}

#[test]
fn every_code_of_the_protocol_is_served() {
    let statements = statements();
    for code in [
        code::PING,
        code::MOVE_JOINTS,
        code::JOINTS,
        code::TOOL,
        code::SPEED,
        code::ZONE,
        code::CORRECT,
        code::CLOCK,
        code::STREAM,
        code::TEMPERATURE,
        code::IDENTIFY,
        code::SERIAL_NUMBER,
        code::CLOSE,
    ] {
        assert!(statements.contains(&format!("CASE {code}:")), "code {code}");
    }
    let module = module();
    assert!(module.contains(&format!("LOCAL CONST num VERSION:={};", protocol::VERSION)));
    assert!(module.contains(&format!("\"{:02} 1 \"", code::SAMPLE)));
}

#[test]
fn blocks_are_closed_and_lines_are_plain_ascii() {
    modules().iter().for_each(|module| blocks_of(module));
}

fn blocks_of(module: &str) {
    let mut open: Vec<&str> = Vec::new();
    for statement in statements_of(module) {
        let mut words = statement.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').filter(|w| !w.is_empty());
        let mut first = words.next().unwrap_or_default();
        if first == "LOCAL" {
            first = words.next().unwrap_or_default();
        }
        match first {
            "MODULE" | "PROC" | "FUNC" | "TRAP" | "WHILE" | "FOR" | "TEST" => open.push(match first {
                "MODULE" => "ENDMODULE",
                "PROC" => "ENDPROC",
                "FUNC" => "ENDFUNC",
                "TRAP" => "ENDTRAP",
                "WHILE" => "ENDWHILE",
                "FOR" => "ENDFOR",
                _ => "ENDTEST",
            }),
            "IF" if statement.ends_with("THEN") => open.push("ENDIF"),
            word if word.starts_with("END") => assert_eq!(open.pop(), Some(word), "{statement}"),
            _ => {}
        }
    }
    assert!(open.is_empty(), "{open:?}");
    for line in module.lines() {
        assert!(line.is_ascii() && line.len() <= 90, "{line}");
    }
}

#[test]
fn names_are_short_enough_for_rapid() {
    for statement in modules().iter().flat_map(|module| statements_of(module)) {
        for word in statement.split(|c: char| !c.is_ascii_alphanumeric() && c != '_') {
            assert!(word.len() <= 16, "{word}: 16 characters are safe in every version");
        }
    }
}

#[test]
fn joints_are_read_after_the_arm_has_settled() {
    let [module, other] = modules();
    for (module, motion) in
        [(&module, "MoveAbsJ jTo"), (&module, "MoveL pTo"), (&other, "MoveAbsJ jTo"), (&other, "MoveL pTo")]
    {
        let after = &module[module.find(motion).unwrap()..];
        let next: Vec<&str> = after.lines().map(str::trim).take(2).collect();
        assert!(next[0].contains(",fine,"), "{next:?}");
        assert_eq!(next[1], "WaitRob\\ZeroSpeed;");
    }
}

#[test]
fn the_module_of_the_web_services_has_what_the_client_writes_and_reads() {
    let module = read("TriCalRws.mod");
    for name in ["PERS num nReq{10}", "PERS num nAck", "PERS num nOk", "PERS string sReply"] {
        assert!(module.contains(name), "{name}");
    }
    let statements = statements_of(&module);
    for code in [code::MOVE_JOINTS, code::TOOL, code::SPEED, code::CORRECT, code::IDENTIFY, code::SERIAL_NUMBER] {
        assert!(statements.contains(&format!("CASE {code}:")), "code {code}");
    }
    assert!(module.contains(&format!("LOCAL CONST num VERSION:={};", protocol::VERSION)));
    // both sides of the program share one set of limits
    let limits = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|line| line.contains("CONST num MAX_") || line.contains("CONST num JOINT_"));
        lines.map(str::to_owned).collect()
    };
    assert_eq!(limits(&module), limits(&self::module()));
    assert_eq!(limits(&module).len(), 8);
}

#[test]
fn the_server_starts_with_a_secret_only_and_looks_at_nothing_else_before_it() {
    let module = module();
    for text in ["string SECRET:=\"\";", "string CLIENT:=\"\";", "StrLen(SECRET)<8 AND SECRET<>\"none\""] {
        assert!(module.contains(text), "{text}");
    }
    for reason in [protocol::SECRET_EXPECTED, protocol::SECRET_WRONG, protocol::SECRET_NOT_SET, protocol::NO_SECRET] {
        assert!(module.contains(&format!("\"{reason}\"")), "{reason}");
    }
    // the same text as the client sends
    assert_eq!(protocol::write_login("SECRET"), "27 SECRET #");
    assert!(module.contains("sMessage=\"27 \"+SECRET+\" \""));
    let place = |text: &str| module.find(text).unwrap();
    assert!(place("Login sMessage") < place("NOT Parse(sMessage)"));
    assert!(place("sClient<>CLIENT") < place("bConnected:=TRUE"));
}
