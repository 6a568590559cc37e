//! A change to a message must change the hash: otherwise two incompatible sides would exchange frames with valid checksums.

use mortise_protocol::message::{FromDevice, ToDevice};
use postcard_schema::Schema;
use postcard_schema::key::Key;
use postcard_schema::schema::{DataModelType, DataModelVariant, NamedType};

/// The same small table in versions that each differ in one respect.
mod tables {
    pub mod original {
        #[derive(postcard_schema::Schema)]
        #[allow(dead_code)]
        pub enum Inner {
            One,
            Two { axis: u8 },
        }
        #[derive(postcard_schema::Schema)]
        #[allow(dead_code)]
        pub enum Table {
            Stop,
            Set { value: f32, inner: Inner },
        }
    }
    macro_rules! changed {
        ($name:ident, { $($inner:tt)* }, { $($table:tt)* }) => {
            pub mod $name {
                #[derive(postcard_schema::Schema)]
                #[allow(dead_code)]
                pub enum Inner { $($inner)* }
                #[derive(postcard_schema::Schema)]
                #[allow(dead_code)]
                pub enum Table { $($table)* }
            }
        };
    }
    changed!(field_type, { One, Two { axis: u8 } }, { Stop, Set { value: f64, inner: Inner } });
    changed!(field_name, { One, Two { axis: u8 } }, { Stop, Set { amount: f32, inner: Inner } });
    changed!(field_added, { One, Two { axis: u8 } }, { Stop, Set { value: f32, inner: Inner, more: u8 } });
    changed!(field_order, { One, Two { axis: u8 } }, { Stop, Set { inner: Inner, value: f32 } });
    changed!(variant_added, { One, Two { axis: u8 } }, { Stop, Set { value: f32, inner: Inner }, More });
    changed!(variant_order, { One, Two { axis: u8 } }, { Set { value: f32, inner: Inner }, Stop });
    changed!(variant_name, { One, Two { axis: u8 } }, { Halt, Set { value: f32, inner: Inner } });
    changed!(nested_variant_added, { One, Two { axis: u8 }, Three }, { Stop, Set { value: f32, inner: Inner } });
    changed!(nested_field_type, { One, Two { axis: u16 } }, { Stop, Set { value: f32, inner: Inner } });
}

#[test]
fn every_kind_of_change_changes_the_key() {
    let original = Key::for_path::<tables::original::Table>("to");
    let changed = [
        ("field type", Key::for_path::<tables::field_type::Table>("to")),
        ("field name", Key::for_path::<tables::field_name::Table>("to")),
        ("field added", Key::for_path::<tables::field_added::Table>("to")),
        ("field order", Key::for_path::<tables::field_order::Table>("to")),
        (
            "variant added",
            Key::for_path::<tables::variant_added::Table>("to"),
        ),
        (
            "variant order",
            Key::for_path::<tables::variant_order::Table>("to"),
        ),
        ("variant name", Key::for_path::<tables::variant_name::Table>("to")),
        (
            "nested variant",
            Key::for_path::<tables::nested_variant_added::Table>("to"),
        ),
        (
            "nested field",
            Key::for_path::<tables::nested_field_type::Table>("to"),
        ),
    ];
    for (i, (what, key)) in changed.iter().enumerate() {
        assert_ne!(*key, original, "{what}");
        assert!(
            changed[..i].iter().all(|(_, other)| other != key),
            "{what} collides"
        );
    }
}

/// Names of all types reachable from `ty`.
fn names(ty: &'static NamedType, found: &mut Vec<&'static str>) {
    if found.contains(&ty.name) && !matches!(ty.ty, DataModelType::Seq(_) | DataModelType::Option(_)) {
        return;
    }
    found.push(ty.name);
    match ty.ty {
        DataModelType::Seq(inner) | DataModelType::Option(inner) | DataModelType::NewtypeStruct(inner) => {
            names(inner, found);
        }
        DataModelType::Tuple(all) | DataModelType::TupleStruct(all) => {
            all.iter().for_each(|ty| names(ty, found));
        }
        DataModelType::Struct(fields) => fields.iter().for_each(|field| names(field.ty, found)),
        DataModelType::Enum(variants) => {
            for variant in *variants {
                match variant.ty {
                    DataModelVariant::UnitVariant => {}
                    DataModelVariant::NewtypeVariant(inner) => names(inner, found),
                    DataModelVariant::TupleVariant(all) => all.iter().for_each(|ty| names(ty, found)),
                    DataModelVariant::StructVariant(fields) => {
                        fields.iter().for_each(|field| names(field.ty, found));
                    }
                }
            }
        }
        _ => {}
    }
}

/// The two tables that form the hash reach every type that crosses the link.
#[test]
fn the_hash_covers_every_type_on_the_wire() {
    let mut found = Vec::new();
    names(ToDevice::SCHEMA, &mut found);
    names(FromDevice::SCHEMA, &mut found);
    for wanted in [
        "Version",
        "ParameterId",
        "ConstraintTarget",
        "ConstraintKind",
        "Feature",
        "HandScript",
        "Keyframe",
        "InputFault",
        "InputFaultKind",
        "WirePose",
        "Capabilities",
        "CostUnit",
        "ResetReason",
        "DeviceState",
        "Fault",
        "Refusal",
        "ImageError",
        "Telemetry",
        "WireWrench",
        "TouchingPair",
        "Statistics",
        "Rig",
        "Kinematics",
        "Mount",
        "Joint",
        "Wrist",
        "RigCeilings",
        "RigFault",
        "RigKey",
    ] {
        assert!(found.contains(&wanted), "{wanted} is not among {found:?}");
    }
}
