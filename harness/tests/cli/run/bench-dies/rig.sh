#!/bin/sh
read -r request
echo '{"names":["lamp"]}'
