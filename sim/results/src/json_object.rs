//! What programs read of a result.

use serde::Serialize;
use serde_json::{Map, Value};

/// What programs read, by its keys; numbers that are not finite become null.
pub(crate) fn json_object(values: &impl Serialize) -> Map<String, Value> {
    match serde_json::to_value(values) {
        Ok(Value::Object(values)) => values,
        other => unreachable!("values have keys, and keys are text: {other:?}"),
    }
}
