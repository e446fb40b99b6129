//! A stage as text (.usda, version 1.0), for tests to look at.

use std::io::{self, Write};

use glam::Vec3;

use super::super::stage::{Prim, Property, Stage, Value};

pub(super) fn write(stage: &Stage<'_>, out: &mut impl Write) -> io::Result<()> {
    let (rate, up) = (stage.rate, stage.up);
    let end = stage.codes.last().unwrap_or(&0);
    writeln!(out, "#usda 1.0\n(")?;
    if let Some(first) = stage.prims.first() {
        writeln!(out, "    defaultPrim = \"{}\"", first.name)?;
    }
    writeln!(out, "    doc = {}", quoted(stage.made_by))?;
    writeln!(out, "    endTimeCode = {end}")?;
    writeln!(out, "    framesPerSecond = {rate}")?;
    writeln!(out, "    metersPerUnit = 1")?;
    writeln!(out, "    startTimeCode = 0")?;
    writeln!(out, "    timeCodesPerSecond = {rate}")?;
    writeln!(out, "    upAxis = \"{up}\"\n)")?;
    for prim in &stage.prims {
        writeln!(out)?;
        write_prim(stage, prim, out, 0)?;
    }
    Ok(())
}

fn write_prim(
    stage: &Stage<'_>,
    prim: &Prim<'_>,
    out: &mut impl Write,
    depth: usize,
) -> io::Result<()> {
    let pad = "    ".repeat(depth);
    write!(out, "{pad}def {} \"{}\"", prim.kind, prim.name)?;
    if prim.is_component || !prim.applies.is_empty() {
        writeln!(out, " (")?;
        if prim.is_component {
            writeln!(out, "{pad}    kind = \"component\"")?;
        }
        if !prim.applies.is_empty() {
            let applies = prim.applies.join("\", \"");
            writeln!(out, "{pad}    prepend apiSchemas = [\"{applies}\"]")?;
        }
        write!(out, "{pad})")?;
    }
    writeln!(out, "\n{pad}{{")?;
    for property in &prim.properties {
        write_property(stage, property, out, &format!("{pad}    "))?;
    }
    for (number, child) in prim.children.iter().enumerate() {
        if number > 0 || !prim.properties.is_empty() {
            writeln!(out)?;
        }
        write_prim(stage, child, out, depth + 1)?;
    }
    writeln!(out, "{pad}}}")
}

fn write_property(
    stage: &Stage<'_>,
    property: &Property<'_>,
    out: &mut impl Write,
    pad: &str,
) -> io::Result<()> {
    let uniform = if property.is_uniform { "uniform " } else { "" };
    let title = match property.kind {
        "" => format!("rel {}", property.name),
        kind => format!("{uniform}{kind} {}", property.name),
    };
    let metadata = match property.interpolation {
        Some(how) => format!(" (\n{pad}    interpolation = \"{how}\"\n{pad})"),
        None => String::new(),
    };
    match &property.value {
        Value::Nothing => writeln!(out, "{pad}{title}"),
        Value::Source(path) => writeln!(out, "{pad}{title}.connect = <{path}>"),
        Value::Frames(_) | Value::Places(_) => {
            if !metadata.is_empty() {
                writeln!(out, "{pad}{title}{metadata}")?;
            }
            writeln!(out, "{pad}{title}.timeSamples = {{")?;
            for (number, code) in stage.codes.iter().enumerate() {
                write!(out, "{pad}    {code}: ")?;
                match &property.value {
                    Value::Places(place) => write_point(out, &place(number))?,
                    Value::Frames(of) => write_list(out, of(number)?.iter(), write_point)?,
                    _ => {}
                }
                writeln!(out, ",")?;
            }
            writeln!(out, "{pad}}}")
        }
        value => {
            write!(out, "{pad}{title} = ")?;
            write_value(value, out)?;
            writeln!(out, "{metadata}")
        }
    }
}

fn write_value(value: &Value<'_>, out: &mut impl Write) -> io::Result<()> {
    match value {
        Value::Flag(flag) => write!(out, "{}", u8::from(*flag)),
        Value::Token(token) => write!(out, "\"{token}\""),
        Value::Tokens(tokens) => {
            write_list(out, tokens.iter(), |out, token| write!(out, "\"{token}\""))
        }
        Value::Number(number) => write!(out, "{number}"),
        Value::Whole(numbers) => {
            write_list(out, numbers.iter(), |out, number| write!(out, "{number}"))
        }
        Value::Pairs(pairs) => write_list(out, pairs.iter(), |out, p| {
            write!(out, "({}, {})", p.x, p.y)
        }),
        Value::Triple(p) => write_point(out, p),
        Value::Triples(points) => write_list(out, points.iter(), write_point),
        Value::Target(path) => write!(out, "<{path}>"),
        Value::Nothing | Value::Source(_) | Value::Frames(_) | Value::Places(_) => Ok(()),
    }
}

/// A string of USD: what cannot stand in one is escaped.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            c if c.is_control() => quoted.push(' '),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

fn write_point<W: Write>(out: &mut W, p: &Vec3) -> io::Result<()> {
    write!(out, "({}, {}, {})", p.x, p.y, p.z)
}

/// `[a, b]`.
fn write_list<W: Write, T>(
    out: &mut W,
    items: impl Iterator<Item = T>,
    write_item: impl Fn(&mut W, T) -> io::Result<()>,
) -> io::Result<()> {
    write!(out, "[")?;
    for (k, item) in items.enumerate() {
        write!(out, "{}", if k == 0 { "" } else { ", " })?;
        write_item(out, item)?;
    }
    write!(out, "]")
}
