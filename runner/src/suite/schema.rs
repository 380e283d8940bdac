//! The JSON schemas of suites, words and named steps as people write them: that of the plain steps,
//! which comes from their types, and what is expanded into them. Words are any texts.

use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

use super::definition::KEYS;
use super::expand::{EVERY_CASE, INSTEAD, JOINED, OF_OBJECTS, TABLE};
use super::model::SuiteFile;
use super::words::{OF_BENCH, OF_OBJECT, PARTS};

/// The schema of suites.
pub fn suite_schema() -> Value {
    let mut schema = plain();
    let mut cases = json!({ "type": "object", "additionalProperties": false, "properties": {} });
    for key in INSTEAD.iter().chain(&JOINED) {
        cases["properties"][key] = schema["definitions"]["Case"]["properties"][key].clone();
    }
    cases["description"] = "What all cases have in common.".into();
    schema["properties"][EVERY_CASE] = cases;
    schema["properties"]["define"] = named_steps();
    schema
}

/// The schema of files with named steps.
pub fn steps_schema() -> Value {
    let mut schema = named_steps();
    schema["$schema"] = plain()["$schema"].take();
    schema["title"] = "NamedSteps".into();
    let all = plain()["definitions"].take();
    let mut used = Map::new();
    let mut open = vec![schema.clone()];
    while let Some(part) = open.pop() {
        for name in named_in(&part) {
            if !used.contains_key(&name) {
                open.push(all[&name].clone());
                used.insert(name.clone(), all[&name].clone());
            }
        }
    }
    schema["definitions"] = used.into();
    schema
}

/// The schema of files with words.
pub fn words_schema() -> Value {
    let address = json!({
        "type": "string",
        "pattern": "^[0-9A-Fa-f{}.]+:[0-9A-Fa-f{}.]+$",
        "description": "An address such as `\"1017:00\"`, or of a family `\"2500:{01..0E}\"`."
    });
    let keys = |names: &[&str], required: &[&str]| {
        let mut properties = Map::new();
        for name in names {
            let schema = match *name {
                "at" => address.clone(),
                "means" => json!({
                    "type": "string",
                    "description": "The table under `values` with the words for its values."
                }),
                "scale" => json!({
                    "type": "number",
                    "exclusiveMinimum": 0,
                    "description": "What one count is worth, such as 0.1."
                }),
                _ => json!({ "type": "string", "description": "The unit, such as `°C`." }),
            };
            properties.insert((*name).to_owned(), schema);
        }
        json!({
            "type": "object",
            "properties": properties,
            "required": required,
            "additionalProperties": false,
            "minProperties": 1
        })
    };
    let numbers = json!({ "type": "object", "additionalProperties": { "type": "integer" } });
    let bound: Vec<&str> = OF_OBJECT.into_iter().filter(|key| *key != "at").collect();
    let mut parts = Map::new();
    for part in PARTS {
        let mut schema = match part {
            "values" => json!({ "additionalProperties": numbers }),
            "objects" => json!({
                "patternProperties": { "^\\$": keys(&bound, &[]) },
                "additionalProperties": { "anyOf": [address, keys(&OF_OBJECT, &["at"])] }
            }),
            "records" => json!({ "additionalProperties": {
                "type": "array",
                "items": { "type": "string" },
                "minItems": 1
            } }),
            "refusals" => json!({ "additionalProperties": refusals() }),
            "frames" => json!({ "additionalProperties": { "type": "string", "pattern": "#" } }),
            _ => json!({ "additionalProperties": keys(&OF_BENCH, &[]) }),
        };
        schema["type"] = "object".into();
        schema["description"] = of_part(part).into();
        parts.insert(part.to_owned(), schema);
    }
    json!({
        "$schema": plain()["$schema"],
        "title": "Words",
        "description": "What a document calls its objects, its values and what belongs to them.",
        "type": "object",
        "properties": parts,
        "additionalProperties": false
    })
}

fn of_part(part: &str) -> &'static str {
    match part {
        "values" => "Tables of the document: words and the values that they stand for.",
        "objects" => "Words for objects; `{1..4}` in word and address makes a family.",
        "records" => "Objects that belong together, in the order in which they are written.",
        "refusals" => "Words for `refused`, `or-refused` and `lenient`.",
        "frames" => "Words for frames.",
        _ => "Units of the names of the bench.",
    }
}

/// Codes, those of a conformant device and those that are accepted, or a list of them.
fn refusals() -> Value {
    let codes = json!({ "type": "array", "items": {
        "anyOf": [{ "type": "integer" }, { "enum": ["any", "taken"] }]
    } });
    let code = json!({ "anyOf": [
        { "type": "integer" },
        { "type": "array", "items": { "type": "integer" } }
    ] });
    json!({ "anyOf": [{ "type": "integer" }, codes, {
        "type": "object",
        "properties": { "code": code, "lenient": codes },
        "required": ["code"],
        "additionalProperties": false
    }] })
}

/// That of the types, with what stands for plain steps.
fn plain() -> Value {
    let schema = SchemaSettings::draft07().into_generator().into_root_schema_for::<SuiteFile>();
    let mut schema = schema.to_value();
    let Some(definitions) = schema["definitions"].as_object_mut() else { return schema };
    let requires = json!({ "anyOf": [
        { "$ref": "#/definitions/Requires" },
        { "type": "string", "description": "An entry of the data sheet." },
        {
            "description": "An entry of the data sheet, with its access.",
            "type": "object",
            // A column may say whether something is there or not.
            "patternProperties": { "^\\$": { "type": "string" } },
            "propertyNames": { "not": { "enum": keys_of(&definitions["Requires"]) } },
            "additionalProperties": { "$ref": "#/definitions/AccessName" },
            "minProperties": 1,
            "maxProperties": 1
        }
    ] });
    definitions["Case"]["properties"]["requires"]["items"] = requires;
    definitions.values_mut().for_each(columns_in);
    for (of, key) in REFUSED {
        let refused = &mut definitions[of]["properties"][key];
        let word = json!({ "type": "string", "description": "A word for a refusal." });
        *refused = either(refused.take(), word);
    }
    for of in OF_OBJECTS {
        several(definitions, of);
    }
    let case = &mut definitions["Case"];
    case["properties"]["for"] = columns();
    case["properties"]["rows"] = rows();
    case["dependencies"] = json!({ "for": ["rows"], "rows": ["for"] });
    let more = [table_of_steps(), use_of_steps()];
    definitions["Step"]["oneOf"].as_array_mut().into_iter().for_each(|steps| {
        steps.extend(more.clone());
    });
    definitions.insert("Column".to_owned(), column());
    schema
}

/// Where words for refusals may stand.
const REFUSED: [(&str, &str); 5] = [
    ("Write", "refused"),
    ("Write", "or-refused"),
    ("Read", "refused"),
    ("Read", "lenient"),
    ("Remap", "refused"),
];

fn column() -> Value {
    json!({
        "type": "string",
        "pattern": "\\$",
        "description": "The value of a column, or of an argument of named steps."
    })
}

fn columns() -> Value {
    json!({
        "type": "array",
        "items": { "type": "string" },
        "minItems": 1,
        "description": "The columns of a table, each of them used as `$column`."
    })
}

fn rows() -> Value {
    json!({
        "anyOf": [{ "type": "array", "minItems": 1 }, { "$ref": "#/definitions/Column" }],
        "description": "The rows of a table: a list of values each, or the one value."
    })
}

fn table_of_steps() -> Value {
    let mut properties = Map::new();
    for key in TABLE {
        let schema = match key {
            "for" => columns(),
            "rows" => rows(),
            _ => list_of_steps(),
        };
        properties.insert(key.to_owned(), schema);
    }
    json!({
        "description": "The steps once for each row of a table.",
        "type": "object",
        "properties": properties,
        "required": TABLE,
        "additionalProperties": false
    })
}

fn use_of_steps() -> Value {
    json!({
        "description": "Named steps, with their arguments if they take any.",
        "type": "object",
        "properties": { "use": { "anyOf": [
            { "type": "string" },
            {
                "type": "object",
                "additionalProperties": { "type": "object" },
                "minProperties": 1,
                "maxProperties": 1
            }
        ] } },
        "required": ["use"],
        "additionalProperties": false
    })
}

fn list_of_steps() -> Value {
    json!({ "type": "array", "items": { "$ref": "#/definitions/Step" } })
}

/// Steps by their names.
fn named_steps() -> Value {
    let mut properties = Map::new();
    for key in KEYS {
        let schema = match key {
            "says" => json!({ "type": "string", "description": "What they do, in a sentence." }),
            "takes" => json!({
                "type": "array",
                "items": { "anyOf": [
                    { "type": "string" },
                    { "type": "object", "minProperties": 1, "maxProperties": 1 }
                ] },
                "description": "What they are given; those with a default as `{ name: default }`."
            }),
            _ => list_of_steps(),
        };
        properties.insert(key.to_owned(), schema);
    }
    json!({
        "description": "Steps that are used by their names.",
        "type": "object",
        "additionalProperties": {
            "type": "object",
            "properties": properties,
            "required": ["says", "steps"],
            "additionalProperties": false
        }
    })
}

/// A step on several objects beside the one on one object.
fn several(definitions: &mut Map<String, Value>, of: (&str, &str, &[&str], &[&str])) {
    let (step, object, shared, single) = of;
    let name = step[..1].to_uppercase() + &step[1..];
    let one = definitions[&name].clone();
    let keys = |wanted: &dyn Fn(&str) -> bool| -> Map<String, Value> {
        let all = one["properties"].as_object().into_iter().flatten();
        let wanted = all.filter(|(key, _)| wanted(key));
        wanted.map(|(key, schema)| (key.clone(), schema.clone())).collect()
    };
    let scalar = match step {
        "write" => json!(["number", "boolean", "string"]),
        _ => json!(["number", "boolean", "string", "null"]),
    };
    let value = json!({
        "description": "A value, those of a record in their order, or keys of this object.",
        "anyOf": [
            { "type": scalar },
            { "type": "array", "minItems": 1 },
            {
                "type": "object",
                "properties": keys(&|key| key != object),
                "minProperties": 1,
                "additionalProperties": false
            }
        ]
    });
    let required = one["required"].as_array().into_iter().flatten();
    let required: Vec<&Value> = required.filter(|key| *key != object).collect();
    let known: Vec<&str> = [&[object][..], single].concat();
    let several = json!({
        "description": "The same of several objects, each with its value.",
        "type": "object",
        "properties": keys(&|key| shared.contains(&key)),
        "propertyNames": { "not": { "enum": known } },
        "additionalProperties": value,
        "required": required,
        // It names an object.
        "not": { "propertyNames": { "enum": shared } }
    });
    let both = format!("Several{name}");
    definitions.insert(both.clone(), several);
    let steps = definitions["Step"]["oneOf"].as_array_mut().into_iter().flatten();
    for known in steps.filter(|known| known["properties"][step].is_object()) {
        let one = known["properties"][step].take();
        let several = json!({ "$ref": format!("#/definitions/{both}") });
        known["properties"][step] = json!({ "anyOf": [several, one] });
    }
}

/// Allows columns in place of anything that is not text, and in its parts.
fn or_column(schema: &mut Value) {
    let is_text = match &schema["type"] {
        Value::Array(types) => types.iter().any(|of| of == "string"),
        of => of == "string" && schema.get("const").is_none() && schema.get("enum").is_none(),
    };
    let is_step = |schema: &Value| schema["$ref"] == "#/definitions/Step";
    if is_text || is_step(schema) || is_step(&schema["items"]) {
        return;
    }
    columns_in(schema);
    *schema = either(schema.take(), json!({ "$ref": "#/definitions/Column" }));
}

/// Columns in place of the parts of a schema.
fn columns_in(schema: &mut Value) {
    let Value::Object(parts) = schema else { return };
    for (key, part) in parts {
        match (key.as_str(), part) {
            ("properties", Value::Object(all)) => all.values_mut().for_each(or_column),
            ("oneOf" | "anyOf", Value::Array(all)) => all.iter_mut().for_each(columns_in),
            ("items" | "additionalProperties", part @ Value::Object(_)) => or_column(part),
            _ => {}
        }
    }
}

/// A schema or another one, with the description of the first.
fn either(mut one: Value, other: Value) -> Value {
    let parts = one.as_object_mut();
    let (description, default) = match parts {
        Some(parts) => (parts.remove("description"), parts.remove("default")),
        None => (None, None),
    };
    let mut both = json!({ "anyOf": [one, other] });
    for (key, value) in [("description", description), ("default", default)] {
        if let Some(value) = value {
            both[key] = value;
        }
    }
    both
}

fn keys_of(definition: &Value) -> Vec<&str> {
    definition["properties"]
        .as_object()
        .into_iter()
        .flat_map(Map::keys)
        .map(String::as_str)
        .collect()
}

/// The definitions that a schema names.
fn named_in(schema: &Value) -> Vec<String> {
    match schema {
        Value::Object(parts) => {
            let own = parts.get("$ref").and_then(Value::as_str);
            let own = own.and_then(|path| path.strip_prefix("#/definitions/")).map(str::to_owned);
            parts.values().flat_map(named_in).chain(own).collect()
        }
        Value::Array(parts) => parts.iter().flat_map(named_in).collect(),
        _ => Vec::new(),
    }
}
