//! One ascii record. The crate's own reader takes no `nan` or `inf`, which other programs do write.

use ply_rs_bw::ply::{ElementDef, PropertyAccess, PropertyAccessResult as Outcome, PropertyType, ScalarType};

/// The record on one line.
pub(super) fn record<E: PropertyAccess>(line: &str, element: &ElementDef) -> Result<E, String> {
    let mut words = line.split_ascii_whitespace();
    let mut record = E::new();
    for (name, property) in &element.properties {
        let mut word = || words.next().ok_or_else(|| format!("the line ends before {name}"));
        let outcome = match &property.data_type {
            PropertyType::Scalar(ScalarType::Float | ScalarType::Double) => record.set_double(name, real(word()?)?),
            PropertyType::Scalar(_) => {
                let value = whole(word()?)?;
                match (i32::try_from(value), u32::try_from(value)) {
                    (Ok(value), _) => record.set_int(name, value),
                    (_, Ok(value)) => record.set_uint(name, value),
                    _ => return Err(format!("{name} is out of range")),
                }
            }
            PropertyType::List(_, kind) => {
                let count = whole(word()?)?;
                if matches!(kind, ScalarType::Float | ScalarType::Double) {
                    let values = (0..count).map(|_| real(word()?)).collect::<Result<Vec<_>, _>>()?;
                    record.set_list_double(name, values)
                } else {
                    let values = (0..count).map(|_| whole(word()?)).collect::<Result<Vec<_>, _>>()?;
                    let unsigned: Option<Vec<u32>> = values.iter().map(|&v| u32::try_from(v).ok()).collect();
                    match (unsigned, values.iter().map(|&v| i32::try_from(v).ok()).collect::<Option<Vec<_>>>()) {
                        (Some(values), _) => record.set_list_uint(name, values),
                        (_, Some(values)) => record.set_list_int(name, values),
                        _ => return Err(format!("{name} is out of range")),
                    }
                }
            }
        };
        if outcome == Outcome::UnsupportedType {
            return Err(format!("{name} has a type that is not possible"));
        }
    }
    Ok(record)
}

fn real(word: &str) -> Result<f64, String> {
    word.parse().map_err(|_| format!("{word:?} is not a number"))
}

fn whole(word: &str) -> Result<i64, String> {
    word.parse().map_err(|_| format!("{word:?} is not a whole number"))
}
