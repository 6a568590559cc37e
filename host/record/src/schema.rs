//! JSON schemas of the messages, made of the schemas that the protocol itself has, so that other programs know every signal by name.

use postcard_schema::schema::{DataModelType, DataModelVariant, NamedType};
use serde_json::{Value, json};

/// The JSON schema of a type as `serde_json` writes it.
pub(crate) fn json_schema(of: &NamedType) -> Value {
    let mut schema = describe(of.ty);
    schema["title"] = json!(of.name);
    schema
}

fn describe(of: &DataModelType) -> Value {
    use DataModelType as T;
    match of {
        T::Bool => json!({"type": "boolean"}),
        T::I8 | T::I16 | T::I32 | T::I64 | T::I128 | T::Isize => json!({"type": "integer"}),
        T::U8 | T::U16 | T::U32 | T::U64 | T::U128 | T::Usize => json!({"type": "integer", "minimum": 0}),
        T::F32 | T::F64 => json!({"type": "number"}),
        T::Char | T::String => json!({"type": "string"}),
        T::ByteArray => json!({"type": "array", "items": {"type": "integer"}}),
        T::Option(inner) => json!({"oneOf": [{"type": "null"}, describe(inner.ty)]}),
        T::Unit | T::UnitStruct => json!({"type": "null"}),
        T::NewtypeStruct(inner) => describe(inner.ty),
        T::Seq(inner) => json!({"type": "array", "items": describe(inner.ty)}),
        T::Tuple(items) | T::TupleStruct(items) => tuple(items),
        T::Map { val, .. } => json!({"type": "object", "additionalProperties": describe(val.ty)}),
        T::Struct(fields) => object(fields.iter().map(|field| (field.name, describe(field.ty.ty)))),
        T::Enum(variants) => json!({"oneOf": variants.iter().map(|variant| {
            let inner = match variant.ty {
                DataModelVariant::UnitVariant => return json!({"const": variant.name}),
                DataModelVariant::NewtypeVariant(inner) => describe(inner.ty),
                DataModelVariant::TupleVariant(items) => tuple(items),
                DataModelVariant::StructVariant(fields) => {
                    object(fields.iter().map(|field| (field.name, describe(field.ty.ty))))
                }
            };
            object([(variant.name, inner)].into_iter())
        }).collect::<Vec<_>>()}),
        T::Schema => json!({}),
    }
}

fn object<'a>(fields: impl Iterator<Item = (&'a str, Value)>) -> Value {
    json!({"type": "object", "properties": fields.map(|(name, schema)| (name.to_owned(), schema)).collect::<serde_json::Map<_, _>>()})
}

/// Arrays have as many equal items as their length.
fn tuple(items: &[&NamedType]) -> Value {
    match items {
        [first, rest @ ..] if rest.iter().all(|item| item == first) => {
            json!({"type": "array", "items": describe(first.ty), "minItems": items.len(), "maxItems": items.len()})
        }
        _ => {
            json!({"type": "array", "prefixItems": items.iter().map(|item| describe(item.ty)).collect::<Vec<_>>()})
        }
    }
}
