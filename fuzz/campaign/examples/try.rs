//! Development only.
use campaign::*;
use reference_devices::change::{Deviation, Replica};
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::{freedom, mutant};

fn device(reference: &ReferenceDevice, deviation: &Deviation) -> Box<dyn Replica> {
    deviation.build(reference, reference.description.default_node).unwrap()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let name = &args[1];
    let what = args[2].as_str();
    let sessions: u64 = args[3].parse().unwrap();
    let from: u64 = args.get(4).map_or(0, |it| it.parse().unwrap());
    let reference = devices::device(name).unwrap();
    let all: Vec<(String, Deviation, Vec<String>)> = match what {
        "plain" => vec![("plain".into(), Deviation::default(), vec![])],
        "freedoms" => freedom::of(&reference).unwrap().iter().map(|f| (f.name.clone(), f.deviation(), f.allowed_by.clone())).collect(),
        "personalities" => freedom::personalities(&reference).unwrap().iter().map(|f| (f.name.clone(), f.deviation(), vec![])).collect(),
        "mutants" => mutant::of(&reference).unwrap().iter().filter(|m| m.shared && !m.is_of_data_sheet()).map(|m| (m.name.clone(), m.deviation(), m.breaks.clone())).collect(),
        "mix" => {
            let fs = freedom::of(&reference).unwrap();
            let mut r = fastrand::Rng::with_seed(1);
            (0..60).map(|k| {
                let mut chosen: Vec<&freedom::Freedom> = vec![];
                let n = r.usize(2..=6);
                while chosen.len() < n {
                    let f = &fs[r.usize(..fs.len())];
                    let d = freedom::mixture(chosen.iter().copied());
                    if chosen.iter().all(|c| c.agrees_with(f)) && !d.collides_with(&f.deviation()) { chosen.push(f); }
                }
                let names: Vec<&str> = chosen.iter().map(|f| f.name.as_str()).collect();
                (format!("mix{k} {}", names.join(",")), freedom::mixture(chosen), vec![])
            }).collect()
        }
        one => {
            let f = freedom::of(&reference).unwrap().into_iter().find(|f| f.name == one).map(|f| (f.name.clone(), f.deviation(), vec![]));
            let m = mutant::of(&reference).unwrap().into_iter().find(|m| m.name == one).map(|m| (m.name.clone(), m.deviation(), m.breaks.clone()));
            vec![f.or(m).unwrap()]
        }
    };
    let verbose = all.len() == 1;
    let t = std::time::Instant::now();
    let (mut found, mut total, mut right) = (0, 0, 0);
    let mut actions = 0;
    for (label, deviation, breaks) in &all {
        let dev = device(&reference, deviation);
        let mut stage = VirtualDevice::new(dev, reference.description.settings.bit_rate);
        let described = deviation.described(&reference).unwrap();
        let d = &described.description;
        let mut seen = None;
        let _ = stage.ask(&mut |bus| { seen = Some(look(bus, &d.eds, d.default_node)?); Ok(()) });
        let seen = seen.unwrap_or_default();
        let (eds, settings) = seen.amend(&d.eds, d.default_node, &reference.description.settings);
        let bp = Blueprint::of_sheet(eds, d.default_node, settings).unwrap().with_errors(seen.errors);
        let belief = Belief::new(&bp, Tolerance::VIRTUAL, session::Start::SwitchedOn, vec![]).unwrap();
        let mut c = Campaign::new(&bp, belief, Powers::ALL, 1);
        let mut findings = vec![];
        for n in from..from + sessions {
            match c.session(&mut stage, n) {
                Ok(None) => {}
                Ok(Some(f)) => {
                    if verbose {
                        println!("session {n}: {} at {}", f.violation, f.violation.at);
                        let k = f.seen.len();
                        for s in &f.seen[k.saturating_sub(30)..] {
                            match s {
                                Seen::Frame(s) => println!("   {} {} {}  {}", s.at, if s.own {"TX"} else {"RX"}, s.frame, canopen::meaning(&s.frame)),
                                other => println!("   {other:?}"),
                            }
                        }
                        println!("   actions: {:?}", f.session.actions.iter().rev().take(8).map(|a| format!("{:?} {:?}", a.does, a.then)).collect::<Vec<_>>());
                    }
                    findings.push(f);
                    if findings.len() >= 3 { break; }
                }
                Err(e) => { println!("{label}: session {n}: bus {e}"); }
            }
        }
        actions += c.tally().actions;
        total += 1;
        if let Some(first) = findings.first() {
            found += 1;
            let refs: Vec<&Finding> = findings.iter().collect();
            let s = if breaks.is_empty() { vec![] } else { c.suspects(&refs) };
            let guess: Vec<String> = s.iter().take(4).map(|(p, n)| format!("{}({n})[{}]", bp.mutants()[*p].name, bp.mutants()[*p].clauses.join(" "))).collect();
            let mut reqs: Vec<&String> = vec![];
            for (p, _) in &s { for cl in bp.mutants()[*p].clauses.iter().take(1) { if !reqs.contains(&cl) { reqs.push(cl); } } }
            let ok = reqs.iter().take(2).any(|r| breaks.contains(r));
            right += ok as usize;
            println!("{label}: FOUND at {} ({} findings): {} ; {} {guess:?}", first.number, findings.len(), first.violation, if ok {"RIGHT"} else {"-"});
        } else if !verbose && !breaks.is_empty() {
            println!("{label}: missed {breaks:?}");
        }
        let l: Vec<&str> = c.belief().freedoms().map(|f| f.name.as_str()).collect();
        if verbose || (!l.is_empty() && breaks.is_empty()) { println!("   {label} learnt {l:?} followed {:?} void {}", c.tally().followed, c.tally().void); }
        if verbose { println!("goals {} actions {}", c.tally().goals.len(), c.tally().actions); }
    }
    let d = t.elapsed();
    println!("{found} of {total} found, {right} right; {actions} actions in {d:?}: {:.1}/ms", actions as f64 / d.as_secs_f64() / 1000.0);
}
