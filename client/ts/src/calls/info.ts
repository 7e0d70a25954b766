import { type Words, word } from "../words.js";
import { Priority as PriorityNumber } from "../generated/marble/v1/job.js";
import { type OptionSchema as OptionSchemaMessage, OptionSchema_Type } from "../generated/marble/v1/options.js";
import {
  type Counters as CountersMessage,
  Counters as CountersCodec,
  type GetInfoResponse,
  type Limits as LimitsMessage,
  Limits as LimitsCodec,
  type Quota as QuotaMessage,
  Quota as QuotaCodec,
} from "../generated/marble/v1/service.js";
import type { Priority } from "./solve.js";

/** One solver option: its default, range, unit and meaning. */
export interface OptionSchema extends Omit<OptionSchemaMessage, "type"> {
  type?: Words<typeof OptionSchema_Type, "TYPE_">;
}

/** What one client may use on the server. */
export interface Quota extends Omit<QuotaMessage, "priority"> {
  /** The highest priority that the client may use. */
  priority?: Priority;
}

/** The limits of the server; it refuses requests beyond them. */
export interface Limits extends Omit<LimitsMessage, "quota"> {
  quota: Quota;
}

/** Current counters, and totals since the start of the server. */
export interface Counters extends CountersMessage {}

/** Version, limits, options and counters of a server. */
export interface ServerInfo extends Omit<GetInfoResponse, "limits" | "options" | "counters"> {
  limits: Limits;
  options: OptionSchema[];
  counters: Counters;
}

export function infoOf(message: GetInfoResponse): ServerInfo {
  const limits = LimitsCodec.fromPartial(message.limits ?? {});
  const quota = QuotaCodec.fromPartial(limits.quota ?? {});
  return {
    ...message,
    limits: { ...limits, quota: { ...quota, priority: word(PriorityNumber, "PRIORITY_", quota.priority) } },
    options: message.options.map((option) => ({ ...option, type: word(OptionSchema_Type, "TYPE_", option.type) })),
    counters: CountersCodec.fromPartial(message.counters ?? {}),
  };
}
